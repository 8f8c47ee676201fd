"""Multiply a block of six rows and columns by eight columns at once, in vector registers.

The compiler of numba turns no loop over eight columns into vector operations: that is too short for
it to check that the arrays do not overlap. The product is therefore written here in operations on
vectors of eight numbers, which the compiler translates for any processor. A row of a matrix of
30,000 bodies takes a quarter of the time.
"""

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

ROWS = 6
"""Rows and columns of a block."""
COLUMNS = 8
"""Columns that are multiplied at once."""
NUMBER = ir.FloatType()
VECTOR = ir.VectorType(NUMBER, COLUMNS)
BYTES = 4
"""Bytes of a number. The address of a vector is known to be a multiple of this, of no more."""
PLACE = ir.IntType(64)
FAST = ("fast",)
"""Allows the compiler to round the product and the sum at once."""


def _accumulation(operation: str) -> Any:
    """Return a function for compiled loops that adds a product to a vector or subtracts it.

    `operation` is the name of the operation on y and the product, "fadd" or "fsub".
    """

    @intrinsic
    def accumulate(typing: Any, y: Any, i: Any, blocks: Any, entry: Any, x: Any, j: Any) -> Any:
        """Add block number `entry` times part j of x to part i of y, or subtract it.

        y, blocks and x are flat arrays of float32: parts are of 48 numbers, six rows of eight
        columns, and blocks of 36.
        """
        signature = types.void(y, types.intp, blocks, types.intp, x, types.intp)

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> Any:
            def start(argument: int, size: int) -> Any:
                """Return the address of a part of an array, whose number is the next argument."""
                array = context.make_array(signature.args[argument])
                data = array(context, builder, arguments[argument]).data
                return builder.gep(data, [builder.mul(arguments[argument + 1], PLACE(size))])

            def vector_at(first: Any, row: int) -> Any:
                """Return the address of the eight columns of a row."""
                address = builder.gep(first, [PLACE(COLUMNS * row)])
                return builder.bitcast(address, VECTOR.as_pointer())

            def in_all_columns(address: Any) -> Any:
                """Return a vector of eight times the number at an address."""
                number = builder.load(address)
                first = builder.insert_element(VECTOR(ir.Undefined), number, ir.IntType(32)(0))
                return builder.shuffle_vector(first, first, ir.VectorType(ir.IntType(32), 8)(None))

            result = start(0, ROWS * COLUMNS)
            block = start(2, ROWS * ROWS)
            factor = start(4, ROWS * COLUMNS)
            factors = [builder.load(vector_at(factor, row), align=BYTES) for row in range(ROWS)]
            for row in range(ROWS):
                total = builder.load(vector_at(result, row), align=BYTES)
                for column in range(ROWS):
                    number = in_all_columns(builder.gep(block, [PLACE(ROWS * row + column)]))
                    product = builder.fmul(number, factors[column], flags=FAST)
                    total = getattr(builder, operation)(total, product, flags=FAST)
                builder.store(total, vector_at(result, row), align=BYTES)

        return signature, generate

    return accumulate


add_product = _accumulation("fadd")
subtract_product = _accumulation("fsub")
