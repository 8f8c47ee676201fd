"""What a product K u has to move through memory, and how often it multiplies and adds."""

from __future__ import annotations

from typing import Any

from modal.system.operator import ContactOperator

OPERATIONS = 85
"""Multiplications and additions that the loop makes for a contact of two spheres whose levers lie
along its normal, without pre-stress; a test counts them."""

Needs = dict[str, float]


def of_matrix(matrix: Any) -> Needs:
    """The bytes and operations of a sparse matrix times a vector."""
    held = matrix.data.nbytes + matrix.indices.nbytes + matrix.indptr.nbytes
    return {"bytes": held + 2.0 * 8 * matrix.shape[0], "operations": 2.0 * matrix.nnz}


def of_operator(operator: ContactOperator) -> Needs:
    """The same of the loop over contacts: one vector is read, the result read and written."""
    if operator._matrix is not None:
        return of_matrix(operator._matrix)
    on = operator._contacts
    held = [on.rows, on.ends, on.slabs, on.pieces, on.fresh, operator._scale]
    held += [on.lateral, on.aside, on.shear]
    moved = sum(array.nbytes for array in held if array is not None)
    return {
        "bytes": moved + 3.0 * 8 * operator.shape[0],
        "operations": float(OPERATIONS * len(on.rows)),
    }


def limits(needs: Needs, bytes_a_second: float, operations_a_second: float) -> Needs:
    """Columns of a table: the seconds that memory, and arithmetic, take at these rates at least."""
    return {
        "seconds_limit": needs["bytes"] / bytes_a_second,
        "seconds_arithmetic": needs["operations"] / operations_a_second,
    }
