#!/usr/bin/env bash
# Builds the wheel, installs it into a fresh environment, and runs the tests and the example scripts there.
#
#     crates/python/check.sh [INCISE]
#
# INCISE is the binary of the command line, whose results are compared. INCISE_PYTHON_PROFILE is the profile of cargo that
# the wheel is built with, by default `release`; `dev` takes less time to build. Without Python or a package index nothing is
# checked, and the last line says so; with INCISE_REQUIRE_PYTHON=1 that is an error.

set -euo pipefail

here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
if [[ $# -gt 0 ]]; then
    INCISE_CLI=$(realpath -- "$1")
    export INCISE_CLI
fi

scratch=$(mktemp -d)
trap 'rm -rf -- "$scratch"' EXIT

skip() {
    echo "SKIPPED: the Python package is not checked: $*"
    [[ ${INCISE_REQUIRE_PYTHON:-0} == 1 ]] && exit 1
    exit 0
}

command -v python3 >/dev/null || skip "there is no python3"
python3 -c 'import sys; sys.exit(sys.version_info < (3, 9))' || skip "$(python3 --version) is older than 3.9"
python3 -m venv "$scratch/build" >"$scratch/log" 2>&1 || skip "python3 has no venv: $(tail -n 1 -- "$scratch/log")"
timeout 300 "$scratch/build/bin/pip" install -q "maturin>=1.9,<2" >"$scratch/log" 2>&1 ||
    skip "maturin cannot be installed: $(tail -n 1 -- "$scratch/log")"

echo "the wheel"
"$scratch/build/bin/maturin" build --profile "${INCISE_PYTHON_PROFILE:-release}" --locked --manifest-path "$here/Cargo.toml" --out "$scratch/wheels"
files=$(python3 -m zipfile -l "$scratch"/wheels/*.whl)
for file in incise/__init__.pyi incise/py.typed LICENSE-MIT LICENSE-APACHE; do
    [[ $files == *$file* ]] || { echo "the wheel lacks $file" >&2; exit 1; }
done

python3 -m venv "$scratch/fresh"
python=$scratch/fresh/bin/python
"$python" -m pip install -q "$scratch"/wheels/*.whl

# Twice: with NumPy alone, and with the packages for pictures and processes.
scripts() {
    for script in "$here"/examples/*.py; do
        echo "--- $(basename -- "$script")"
        (cd -- "$scratch" && "$python" "$script")
    done
}
echo "the scripts, with NumPy alone"
scripts

"$python" -m pip install -q pytest
for package in joblib matplotlib pyvista meshio scipy; do
    timeout 300 "$python" -m pip install -q "$package" >"$scratch/log" 2>&1 ||
        echo "SKIPPED: without $package, which cannot be installed: $(tail -n 1 -- "$scratch/log")"
done
echo "the tests"
"$python" -m pytest -q -rs -p no:cacheprovider "$here"
echo "the scripts, with pictures"
# A window would wait to be closed.
unset DISPLAY WAYLAND_DISPLAY
scripts
