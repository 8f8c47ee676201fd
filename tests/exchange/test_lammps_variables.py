"""Variables in a log, against the forces of LAMMPS, which has put in their values."""

from __future__ import annotations

import re

import numpy as np
import packings
from lammps_runs import import_written, make_script, needs_lammps, run_lammps, write_data

pytestmark = needs_lammps

VARIABLES = """variable none string ""
variable n index 2
variable k loop 3
variable E equal 4.0e6
variable half equal v_E/2
variable rest string "0 tangential linear_history 3e6 0 3"
variable how string "pair_coeff"
pair_style granular
print "pair_style gran/hooke 1 1 1 1 1 1"
pair_coeff ${none} 1 $k hooke $E ${rest} ${none}
pair_coeff $n 2 hooke $(v_half:%.3e) ${rest} # of type $n
${how} 1 $n hooke &
  $E ${rest}
print "pair_coeff 1 2 hooke 9e6 ${rest}"
variable COEFF string "1 2 hooke 3e6 ${none} ${rest}"
if "$k == 1" then "pair_coeff ${COEFF}"
${none}
fix ${none} nve all nve/sphere"""
"""Commands with variables that a log shows; the last pair_coeff of 1 and 2 holds."""


def test_variables_of_a_log_are_read_as_lammps_puts_them_in(tmp_path):
    """Compare the forces by the law of each pair of types with those that LAMMPS has written."""
    packing = packings.polydisperse(True, n=60)
    write_data(packing, tmp_path / "start.data")
    data = tmp_path / "start.data"
    data.write_text(data.read_text().replace("1 atom types", "2 atom types"))
    script = make_script(packing, "hooke").replace("fix nve all nve/sphere", VARIABLES)
    script = re.sub("pair_style granular\npair_coeff .*", "set atom 1*25 type 2", script)
    run_lammps(tmp_path, script)
    result = import_written(tmp_path)
    assert sorted(law.normal for law in result.laws) == [2e6, 3e6, 4e6]
    stiff = np.array([law.normal for law in result.laws])[result.law]
    # 17 digits of positions of some mm leave 1e-18 m of overlaps of 1e-5 m.
    network = result.network
    np.testing.assert_allclose(stiff * network.overlap, network.force_normal, rtol=1e-9)
