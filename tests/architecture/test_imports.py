"""The direction of imports: packages without cycles, cores without I/O, tools above all."""

from pathlib import PurePath

import networkx as nx
import pytest

from tests.architecture.imports import Import, imports_of

IO_MODULES = frozenset({
    "aiohttp", "asyncio", "can", "concurrent", "http", "multiprocessing", "os", "pathlib", "queue",
    "select", "selectors", "shutil", "signal", "socket", "subprocess", "tempfile", "threading",
    "time", "urllib",
})  # fmt: skip
"""Modules that reach the operating system, the clock or other threads."""

EDGES = frozenset({
    "access/driver_file.py",
    "brake_request/request_outputs.py",
    "detector/detector_socket.py",
    "gnss/gnss_log.py", "gnss/gpsd.py",
    "hmi/access_check.py", "hmi/connection_limiter.py", "hmi/feed.py", "hmi/page_files.py",
    "hmi/page_server.py", "hmi/recording_files.py",
    "interface/event_server.py", "interface/event_stream.py",
    "obd/can_bus.py", "obd/can_log.py", "obd/dbc_file.py", "obd/socketcand.py",
    "recorder/black_box.py", "recorder/build.py", "recorder/reader.py", "recorder/repair.py",
    "recorder/retention.py", "recorder/segment.py", "recorder/segments.py",
    "runtime/candidate_ids.py", "runtime/daemon.py", "runtime/output_sinks.py",
    "runtime/polled_loop.py", "runtime/radio_loss.py", "runtime/service.py", "runtime/systemd.py",
    "runtime/wires.py",
    "security/key_files.py", "security/private_file.py",
    "settings.py", "thread_priority.py",
    "trace/trace_file.py",
    "vision/camera_process.py", "vision/camera_worker.py", "vision/live_frames.py",
    "vision/outputs.py", "vision/plate_detector.py",
    "vision/nanodet.py", "vision/network.py", "vision/vehicle_network.py",
    "vision/plate_reader.py", "vision/recorded_camera.py", "vision/recordings.py",
    "wave_udp/drained_socket.py", "wave_udp/endpoint.py", "wave_udp/iwcu.py", "wave_udp/raw.py",
    "wave_udp/rsu41.py",
})  # fmt: skip
"""Modules of `onboard` that do I/O, besides the command-line tools. All others are cores, codecs
and settings."""


def _package(module: str) -> str | None:
    """Return the first level below the program: a folder, or a module of its own."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else None


def _importing_package(each: Import) -> str:
    parts = PurePath(each.importer).with_suffix("").parts
    return parts[1]


@pytest.mark.parametrize("program", ["onboard", "sim_rig"])
def test_the_packages_of_a_program_import_each_other_in_one_direction(program: str) -> None:
    graph: nx.DiGraph[str] = nx.DiGraph()
    for each in imports_of(program):
        imported = _package(each.module)
        importing = _importing_package(each)
        is_own = each.module.startswith(f"{program}.")
        if is_own and imported is not None and imported != importing:
            graph.add_edge(importing, imported)

    cycles = [sorted(group) for group in nx.strongly_connected_components(graph) if len(group) > 1]
    assert cycles == []


def test_the_car_s_software_never_imports_the_rig() -> None:
    assert [each for each in imports_of("onboard") if each.module.split(".")[0] == "sim_rig"] == []


def test_only_edges_import_modules_that_do_io() -> None:
    found = {
        str(PurePath(each.importer).relative_to("onboard"))
        for each in imports_of("onboard")
        if each.module.split(".")[0] in IO_MODULES and not _is_type_of_a_setting(each)
    }
    assert {path for path in found if not path.startswith("tools/")} == EDGES


def _is_type_of_a_setting(each: Import) -> bool:
    """A settings model names files by `Path`, and opens none."""
    is_settings = PurePath(each.importer).name == "settings.py" or each.importer == (
        "onboard/vehicle/config.py"
    )
    is_base = each.importer == "onboard/settings.py"
    return each.module == "pathlib.Path" and is_settings and not is_base


def test_only_the_command_line_imports_the_tools() -> None:
    importers = {
        each.importer for each in imports_of("onboard") if each.module.startswith("onboard.tools")
    }
    assert {path for path in importers if not path.startswith("onboard/tools/")} == {
        "onboard/__main__.py"
    }
