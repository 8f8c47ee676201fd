"""What a product K u has to move through memory."""

from scipy.sparse import csr_matrix

from modal.system.operator import ContactOperator


def bytes_of(product: ContactOperator | csr_matrix) -> float:
    """Of a sparse matrix times a vector, or of the loop over contacts, which reads its result."""
    operator = isinstance(product, ContactOperator)
    if operator and product._matrix is None:
        on = product._contacts
        held = [on.rows, on.ends, on.slabs, on.pieces, on.fresh, product._scale]
        held += [on.lateral, on.aside, on.shear]
        return sum(array.nbytes for array in held if array is not None) + 24.0 * product.shape[0]
    matrix = product._matrix if operator else product
    held = (matrix.data, matrix.indices, matrix.indptr)
    return sum(array.nbytes for array in held) + 16.0 * matrix.shape[0]
