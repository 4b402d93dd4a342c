"""One name, one meaning: no two public classes share a name."""

from collections import defaultdict

from tests.architecture.syntax import ROOT, files_below, syntax_of

TREES = ("onboard", "sim_rig", "bench", "deploy", "training", "tools")


def test_no_two_public_classes_have_one_name() -> None:
    files = defaultdict(list)
    for path in files_below(*TREES):
        for name in syntax_of(path).classes:
            if not name.startswith("_"):
                files[name].append(str(path.relative_to(ROOT)))

    assert {name: paths for name, paths in files.items() if len(paths) > 1} == {}
