"""Small folders to install, as of `make box`: of an `onboard` that prints its release only."""

import ensurepip
import hashlib
import json
import os
import platform
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
_PROGRAM = """
import os
import sys


def main():
    match sys.argv[1:]:
        case ["--version"]:
            print("onboard {name}")
        case ["check", file]:
            if "{unknown}" in open(file).read():
                sys.exit("{unknown}: unknown key")
        case ["run", file]:
            print("{name} drives", flush=True)
        case ["keys", *_]:
            os.environ["PYTHONPATH"] = {root!r}
            os.execv({python!r}, [{python!r}, "-m", "onboard", *sys.argv[1:]])
"""


def make_bundle(
    folder: Path,
    name: str,
    *,
    unknown: str = "none",
    architecture: str = platform.machine(),
    files: int = 1,
    key: Path | None = None,
) -> Path:
    """Make a folder to install.

    Args:
        folder: the folder.
        name: name of the release.
        unknown: key of a configuration that it refuses.
        architecture: what it is for.
        files: how many modules its only dependency has.
        key: folder of the root that signs it.
    """
    wheels = folder / "wheels"
    wheels.mkdir(parents=True)
    program = _PROGRAM.format(name=name, unknown=unknown, root=str(ROOT), python=sys.executable)
    _wheel(wheels, "onboard", {"onboard/__init__.py": program}, "onboard=onboard:main")
    modules = {f"dependency/module{number}.py": "VALUE = 1\n" * 50 for number in range(files)}
    dependency = _wheel(wheels, "dependency", modules)
    digest = hashlib.sha256(dependency.read_bytes()).hexdigest()
    (folder / "requirements.lock").write_text(f"dependency==1.0 --hash=sha256:{digest}\n")
    (pip,) = Path(ensurepip.__file__).parent.glob("_bundled/pip-*.whl")
    shutil.copy(pip, wheels)
    for file in ("install.sh", "releases.py"):
        shutil.copy(DEPLOY / file, folder)
    shutil.copytree(DEPLOY / "files", folder / "files")
    (folder / "in-the-car.md").write_text(f"The guide of {name}\n")
    (folder / "car.yaml").write_text("car: {plate: AB123}\n")
    about = {"name": name, "architecture": architecture, "python": f"3.{sys.version_info.minor}"}
    (folder / "release.json").write_text(json.dumps(about))
    seal(folder, key)
    return folder


def seal(folder: Path, key: Path | None = None) -> None:
    """Write the hashes, and the signature of the root in the folder `key`."""
    for name in ("SHA256SUMS", "SHA256SUMS.sig"):
        (folder / name).unlink(missing_ok=True)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    sums = (hashlib.sha256(path.read_bytes()).hexdigest() for path in files)
    lines = (
        f"{digest}  {path.relative_to(folder)}\n" for digest, path in zip(sums, files, strict=True)
    )
    (folder / "SHA256SUMS").write_text("".join(lines))
    if key is not None:
        command = ("-m", "onboard", "keys", "sign", folder / "SHA256SUMS", "--root", key)
        subprocess.run([sys.executable, *command], check=True, cwd=ROOT, capture_output=True)


def _wheel(folder: Path, name: str, modules: dict[str, str], script: str = "") -> Path:
    about = f"{name}-1.0.dist-info"
    content = {
        **modules,
        f"{about}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n",
        f"{about}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{about}/entry_points.txt": f"[console_scripts]\n{script}\n" if script else "",
    }
    record = "".join(f"{path},,\n" for path in (*content, f"{about}/RECORD"))
    wheel = folder / f"{name}-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as file:
        for path, text in (content | {f"{about}/RECORD": record}).items():
            file.writestr(path, text)
    return wheel


def install(bundle: Path, root: Path, *options: str) -> "subprocess.CompletedProcess[str]":
    """Run the bundle's install.sh on a computer below `root`, as its user does."""
    return subprocess.run(
        ["sh", bundle / "install.sh", *options],
        env=os.environ | {"ONBOARD_ROOT": str(root)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def boot(root: Path) -> str:
    """Start the service as its unit does; return what the daemon prints, or why there is none."""
    home = root / "opt" / "onboard"
    if not (home / "current").is_symlink():
        return "not installed"
    tool = home / "onboard-releases"
    if tool.exists():
        subprocess.run([sys.executable, tool, "--root", root, "started"], check=False)
    daemon = home / "current" / "venv" / "bin" / "onboard"
    try:
        done = subprocess.run(
            [daemon, "run", "car.yaml"], capture_output=True, text=True, check=False
        )
    except OSError as error:
        return f"203/EXEC: {error.strerror}"
    return (done.stdout + done.stderr).strip()
