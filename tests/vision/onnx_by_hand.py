"""A detector of red squares as an ONNX file, its protobuf written by hand.

The model pools the picture by 8 x 8 pixels, and gives each cell a box of its own size with the
score red - (green + blue) / 2: output (1, 5, cells) as YOLOv8 has it with one class.
Field numbers are those of onnx.proto (IR version 8, opset 13).
"""

from pathlib import Path

import numpy as np

CELL_PX = 8


def write_yolox_like(path: Path, side_px: int = 64) -> None:
    """A model of YOLOX's layout, whose answer is one car (class 1 of 2) of 16 by 16 pixels.

    It is in the second cell of the second row of 8 pixels, with its centre at (12, 12).
    """
    count = sum((side_px // side) ** 2 for side in (8, 16, 32))
    rows = np.zeros((1, count, 7), np.float32)
    rows[0, side_px // 8 + 1] = (0.5, 0.5, np.log(2.0), np.log(2.0), 0.9, 0.1, 1.0)
    nodes = [
        _node(
            "ReduceSum",
            ["picture"],
            "sum",
            [_bytes(1, b"keepdims") + _number(3, 0) + _number(20, 2)],
        ),
        _node("Mul", ["sum", "zero"], "nothing", []),
        _node("Add", ["rows", "nothing"], "found", []),
    ]
    graph = b"".join(
        [
            *(_bytes(1, node) for node in nodes),
            _bytes(2, b"one car"),
            _bytes(5, _tensor("zero", np.zeros((1,), np.float32))),
            _bytes(5, _tensor("rows", rows)),
            _bytes(11, _value("picture", [1, 3, side_px, side_px])),
            _bytes(12, _value("found", [1, count, 7])),
        ]
    )
    model = _number(1, 8) + _bytes(7, graph) + _bytes(8, _bytes(1, b"") + _number(2, 13))
    path.write_bytes(model)


def write_answers(
    path: Path, answers: dict[str, np.ndarray], input_sides: list[int], *, of_bytes: bool = False
) -> None:
    """A model whose outputs are the same for every picture.

    Its input has numbers of 32 bits, or bytes.
    """
    graph = b"".join(
        [
            *(
                _bytes(
                    1,
                    _node(
                        "Identity",
                        [
                            f"{name}_",
                        ],
                        name,
                        [],
                    ),
                )
                for name in answers
            ),
            _bytes(2, b"answers"),
            *(_bytes(5, _tensor(f"{name}_", values)) for name, values in answers.items()),
            _bytes(11, _value("picture", input_sides, 2 if of_bytes else 1)),
            *(_bytes(12, _value(name, list(values.shape))) for name, values in answers.items()),
        ]
    )
    model = _number(1, 8) + _bytes(7, graph) + _bytes(8, _bytes(1, b"") + _number(2, 13))
    path.write_bytes(model)


def write_greedy(path: Path, side_px: int) -> None:
    """A model whose answer has 2^40 pictures."""
    nodes = [
        _node("ConstantOfShape", ["shape"], "huge", []),
        _node("Add", ["picture", "huge"], "found", []),
    ]
    shape = np.array([1 << 40, 3, side_px, side_px], np.int64)
    _write(path, nodes, [_tensor("shape", shape)], shape.tolist())


def write_referring(path: Path, side_px: int) -> None:
    """A model whose weights are another file of the computer's."""
    location = _bytes(1, b"location") + _bytes(2, b"../../../../etc/passwd")
    weights = _number(1, 4) + _number(2, 1) + _bytes(8, b"weights") + _number(14, 1)
    _write(
        path,
        [_node("Add", ["picture", "weights"], "found", [])],
        [weights + _bytes(13, location)],
        [1, 3, side_px, side_px],
    )


def _write(path: Path, nodes: list[bytes], tensors: list[bytes], found: list[int]) -> None:
    graph = b"".join(
        [
            *(_bytes(1, node) for node in nodes),
            _bytes(2, b"hostile"),
            *(_bytes(5, tensor) for tensor in tensors),
            _bytes(11, _value("picture", [1, 3, *found[2:]])),
            _bytes(12, _value("found", found)),
        ]
    )
    model = _number(1, 8) + _bytes(7, graph) + _bytes(8, _bytes(1, b"") + _number(2, 13))
    path.write_bytes(model)


def write_red_square_detector(path: Path, side_px: int = 64, box_px: float = 16.0) -> None:
    cells = side_px // CELL_PX
    count = cells * cells
    mix = np.zeros((5, 3, 1, 1), np.float32)
    mix[4, :, 0, 0] = (1.0, -0.5, -0.5)
    boxes = np.zeros((1, 5, count), np.float32)
    centres = (np.arange(cells) + 0.5) * CELL_PX
    boxes[0, 0] = np.tile(centres, cells)
    boxes[0, 1] = np.repeat(centres, cells)
    boxes[0, 2:4] = box_px
    nodes = [
        _node(
            "AveragePool",
            ["picture"],
            "pooled",
            [_ints("kernel_shape", [CELL_PX] * 2), _ints("strides", [CELL_PX] * 2)],
        ),
        _node("Conv", ["pooled", "mix"], "mixed", [_ints("kernel_shape", [1, 1])]),
        _node("Reshape", ["mixed", "shape"], "flat", []),
        _node("Add", ["flat", "boxes"], "found", []),
    ]
    tensors = [
        _tensor("mix", mix),
        _tensor("shape", np.array([1, 5, count], np.int64)),
        _tensor("boxes", boxes),
    ]
    graph = b"".join(
        [
            *(_bytes(1, node) for node in nodes),
            _bytes(2, b"red squares"),
            *(_bytes(5, tensor) for tensor in tensors),
            _bytes(11, _value("picture", [1, 3, side_px, side_px])),
            _bytes(12, _value("found", [1, 5, count])),
        ]
    )
    model = _number(1, 8) + _bytes(7, graph) + _bytes(8, _bytes(1, b"") + _number(2, 13))
    path.write_bytes(model)


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _bytes(field: int, value: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(value)) + value


def _ints(name: str, values: list[int]) -> bytes:
    numbers = b"".join(_number(8, value) for value in values)
    return _bytes(1, name.encode()) + numbers + _number(20, 7)


def _node(operator: str, inputs: list[str], output: str, attributes: list[bytes]) -> bytes:
    return b"".join(
        [
            *(_bytes(1, name.encode()) for name in inputs),
            _bytes(2, output.encode()),
            _bytes(3, output.encode()),
            _bytes(4, operator.encode()),
            *(_bytes(5, attribute) for attribute in attributes),
        ]
    )


def _tensor(name: str, values: np.ndarray) -> bytes:
    dimensions = b"".join(_number(1, side) for side in values.shape)
    kind = 1 if values.dtype == np.float32 else 7
    raw = values.astype("<f4" if kind == 1 else "<i8").tobytes()
    return dimensions + _number(2, kind) + _bytes(8, name.encode()) + _bytes(9, raw)


def _value(name: str, sides: list[int], element: int = 1) -> bytes:
    dimensions = b"".join(_bytes(1, _number(1, side)) for side in sides)
    kind = _bytes(1, _number(1, element) + _bytes(2, dimensions))
    return _bytes(1, name.encode()) + _bytes(2, kind)
