"""The package of python/: its own tests, and its installation."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import package
from bench import check, same

SOURCE = Path(package.FOLDER)


def run(*arguments, folder=SOURCE, path=None):
    """Runs Python with this path of packages; returns its output."""
    environment = {**os.environ, "PYTHONPATH": str(path or ""), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, *map(str, arguments)], cwd=folder, env=environment, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, timeout=300)
    same(done.returncode, 0, f"exit code of {arguments}:\n{done.stdout}")
    return done.stdout


def makes_wheels():
    """Returns whether setuptools is here, and makes wheels without the package `wheel`."""
    try:
        version = importlib.metadata.version("setuptools")
    except importlib.metadata.PackageNotFoundError:
        return False
    return tuple(map(int, version.split(".")[:2])) >= (70, 1)


def python_package_passes_its_own_tests(_):
    printed = run("-m", "unittest", "discover", "tests")
    count = int(printed.split("Ran ")[1].split()[0])
    check(count >= 80, f"{count} tests")


def python_package_is_installed_by_pip(_):
    """Its dependencies are here. Where a setuptools is that makes wheels, nothing is fetched."""
    with tempfile.TemporaryDirectory() as folder:
        # pip builds in the folder of the sources.
        shutil.copytree(SOURCE, f"{folder}/python", ignore=shutil.ignore_patterns("build", "*.egg-info", "__pycache__"))
        alone = ["--no-build-isolation"] if makes_wheels() else []
        run("-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", *alone, "--target",
            f"{folder}/installed", f"{folder}/python", folder=folder)
        printed = run("-c", "import frhc; print(frhc.__file__); print(frhc.FarSide(socket='/nowhere').period)",
                      folder=folder, path=f"{folder}/installed")
        same(printed, f"{folder}/installed/frhc/__init__.py\n0.002\n", "the installed package")
        sources, installed = ({file.name for file in Path(place).iterdir() if file.is_file()}
                              for place in (SOURCE / "frhc", f"{folder}/installed/frhc"))
        same(installed, sources, "files of the package")


def python_package_has_strict_types(_):
    """A type checker of a program that imports the package relies on these types."""
    with tempfile.TemporaryDirectory() as folder:
        printed = run("-m", "mypy", "--cache-dir", folder)
    check(printed.startswith("Success: no issues found in "), printed)


TESTS = [python_package_passes_its_own_tests, python_package_has_strict_types, python_package_is_installed_by_pip]
