#!/usr/bin/env bash
# Install the wheel in dist/ into an empty environment and fit the bundled scan there: test_wheel.sh PYTHON TORCH
set -euo pipefail
repository=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
wheel=$(ls "$repository"/dist/kpred-*.whl)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$1" -m venv "$folder/venv"
bin=$folder/venv/bin
[ -d "$bin" ] || bin=$folder/venv/Scripts  # Windows
pip=("$bin/python" -m pip --disable-pip-version-check --no-input -qq install -c "$repository/constraints.txt")
"${pip[@]}" "$2"
"${pip[@]}" "$wheel"
mkdir "$folder/home" "$folder/run"
cd "$folder/run"
SECONDS=0
HOME=$folder/home PYTHONPATH='' "$bin/kpred" compile
echo "compilation: $SECONDS s"
SECONDS=0
HOME=$folder/home PYTHONPATH='' "$bin/kpred" demo --no-picture -o demo
echo "first fit after it: $SECONDS s"
for file in demo/chair_scan.obj demo/chair_scan.json; do
    test -s "$file" || { echo "kpred demo wrote no $file" >&2; exit 1; }
done
HOME=$folder/home PYTHONPATH='' "$bin/kpred" info
echo "$(basename "$wheel"): $(du -m "$wheel" | cut -f1) MB, installed and run"
