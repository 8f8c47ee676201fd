"""Write start.data for pack.lmp, a packing without friction at 100 kPa; print its walls."""

import modal

net = modal.random_packing(1600, stress=1e5, seed=3, aspect=11)
side_x, side_y = net.cell_size[:2]
low, high = net.wall_position
with open("start.data", "w") as file:
    print(f"start\n\n{net.n_particles} atoms\n1 atom types\n", file=file)
    for axis, (start, end) in {"x": (0, side_x), "y": (0, side_y), "z": (low, high)}.items():
        print(f"{start:.17g} {end:.17g} {axis}lo {axis}hi", file=file)
    print("\nAtoms # sphere\n", file=file)
    for k in range(net.n_particles):
        x, y, z = net.position[k] % (side_x, side_y, 2 * high)
        print(k + 1, 1, 2 * net.radius[k], 2230, x, y, z, file=file)
print(low, high)
