"""Run all benchmarks, or those named on the command line."""

import argparse
import importlib
import json
import pkgutil
from dataclasses import asdict

import bench


def main() -> None:
    """Print each figure as soon as it is measured."""
    names = [
        module.name for module in pkgutil.iter_modules(bench.__path__) if module.name[0] != "_"
    ]
    parser = argparse.ArgumentParser(prog="python -m bench", description=bench.__doc__)
    parser.add_argument("name", nargs="*", choices=[*names, []], help="default: all")
    for name in parser.parse_args().name or names:
        for figure in importlib.import_module(f"bench.{name}").measure():
            print(json.dumps(asdict(figure) | {"ratio": round(figure.ratio, 4)}), flush=True)


if __name__ == "__main__":
    main()
