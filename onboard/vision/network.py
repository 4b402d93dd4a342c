"""A network of an ONNX file, run by ONNX Runtime on one core: in the thread that asks.

Its outputs are within 1e-4 of OpenCV's for the shipped networks, in 0.4 to 0.8 of the time.
"""

import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

# Else ONNX Runtime writes an identifier of the computer as it is imported, and sends it.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"

import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as failures

_ONLY_FATAL = 4

NETWORK_ERRORS: tuple[type[Exception], ...] = (
    failures.EPFail,
    failures.Fail,
    failures.InvalidArgument,
    failures.InvalidGraph,
    failures.InvalidProtobuf,
    failures.ModelLoaded,
    failures.NoModel,
    failures.NoSuchFile,
    failures.NotImplemented,
    failures.RuntimeException,
    TypeError,
    ValueError,
)
"""What a file that is no network raises, or one that cannot run on an input."""


class Network:
    """One network, loaded once; not to be shared between threads."""

    def __init__(self, file: Path) -> None:
        """Load the file, and no other that it refers to outside the working directory.

        Raises:
            FileNotFoundError: it is missing.
            NETWORK_ERRORS: it is no network that can be run.
        """
        if not file.is_file():
            raise FileNotFoundError(f"no network at {file}")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = _ONLY_FATAL
        # Inputs differ in size: memory is returned after each run, and not kept for the largest.
        options.enable_cpu_mem_arena = options.enable_mem_pattern = False
        self._session: Any = onnxruntime.InferenceSession(
            file.read_bytes(), options, providers=["CPUExecutionProvider"]
        )
        self._input: str = self._session.get_inputs()[0].name
        self._outputs: list[str] = [each.name for each in self._session.get_outputs()]

    def run(self, given: npt.NDArray[np.generic]) -> dict[str, npt.NDArray[np.float32]]:
        """All outputs for one input, by name.

        Raises:
            NETWORK_ERRORS: it cannot run on this input, or has outputs that are no numbers.
        """
        outputs = self._session.run(None, {self._input: given})
        return {
            name: np.asarray(values, np.float32)
            for name, values in zip(self._outputs, outputs, strict=True)
        }

    def run_one(self, given: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """The output of a network that has one.

        Raises:
            NETWORK_ERRORS: as of `run`.
        """
        (output,) = self.run(given).values()
        return output
