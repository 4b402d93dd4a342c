"""One name, one meaning: no two public classes share a name."""

import ast
from collections import defaultdict

from tests.architecture.imports import ROOT

TREES = ("onboard", "sim_rig", "bench", "deploy", "training", "tools")


def test_no_two_public_classes_have_one_name() -> None:
    files = defaultdict(list)
    for tree in TREES:
        for path in sorted((ROOT / tree).rglob("*.py")):
            for node in ast.parse(path.read_text("utf-8")).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    files[node.name].append(str(path.relative_to(ROOT)))

    assert {name: paths for name, paths in files.items() if len(paths) > 1} == {}
