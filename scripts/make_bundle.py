"""Make src/kpred/bundled/ and the weights of paper/ from trained runs: weights, cards, starter database, sample scan.

    python scripts/make_bundle.py RUNS_FOLDER INFINIGEN_FOLDER [--evaluation full.json ...]

RUNS_FOLDER holds runs by `scripts/train_within.py` or `kpred train`, or some of them: CATEGORY of kp-red-plus, `any`
of the shared network, kp-red/CATEGORY of kp-red, recognizer, recognizer/second, recognizer_any and visibility; and
calibration.json by `kpred train confidence`, here and in recognizer_any. INFINIGEN_FOLDER has infinigen's packs.
Everything in the bundle is made from the generator and from infinigen alone. The cards of the categories and of the
recognizer are written; in the others, which say in words how they were trained, measured facts are brought up to date.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from choose_models import choose_models
from torch import nn

from kpred.database import Database, build_database
from kpred.nn import (
    KPRed,
    load_model,
    load_network,
    load_recognizer,
    load_visibility,
    save_network,
    save_recognizer,
    save_visibility,
)
from kpred.nn.calibration import load_calibration, save_calibration
from kpred.nn.config import SHARED
from kpred.nn.loading import RECOGNIZER, SECOND, SHARED_RECOGNIZER, VISIBILITY
from kpred.nn.weights import WEIGHTS_FILE
from kpred.ops import depth_scan
from kpred.shapes import Mesh, MeshPack
from kpred.synthetic.generator import generate

CATEGORIES = ("chair", "table", "cabinet")
REPOSITORY = Path(__file__).resolve().parents[1]
BUNDLED = REPOSITORY / "src" / "kpred" / "bundled"
PAPER = REPOSITORY / "paper" / "src" / "kpred_paper"
GENERATED, REDISTRIBUTED = 300, 60
"""Shapes a category that models of the starter database are chosen from: from the generator, and from infinigen."""
CHOSEN = 130
"""Models a category in the starter database."""
COVERED, COVERED_SEED = 160, 4321
"""Shapes of the generator a category that the chosen models shall explain; a third as many are infinigen's (train)."""
FIRST_RECORD = "training_first.json"
"""Record of the training that another one started from."""
DATABASE_SEED, REDISTRIBUTED_SEED = 12, 11
"""A seed of the generator that training does not use; and of the draw from infinigen."""


def main() -> None:
    """Make the parts that the arguments name."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path)
    parser.add_argument("infinigen", type=Path)
    parser.add_argument("--evaluation", type=Path, nargs="*", default=[], help="JSON of kpred evaluate table full")
    parser.add_argument("--only", choices=("weights", "database", "scan", "cards"), nargs="*")
    options = parser.parse_args()
    parts = options.only or ("weights", "database", "scan", "cards")
    if "weights" in parts:
        copy_weights(options.runs, BUNDLED / "model", PAPER)
    if "database" in parts:
        make_database(options.infinigen)
    if "scan" in parts:
        make_scan(options.infinigen)
    if "cards" in parts:
        write_cards(options.evaluation)


def copy_weights(runs: Path, bundled: Path, paper: Path) -> None:
    """Half-precision weights, calibrations and the records of their training, of the runs that are there."""
    for category in (*CATEGORIES, SHARED):
        for run, target in ((runs / category, bundled), (runs / "kp-red" / category, paper)):
            if (run / "model").is_dir():
                save_network(load_network(run / "model"), target / category)
                copy_record(run / "model", target / category)
    for name in (RECOGNIZER, f"{RECOGNIZER}/{SECOND}", SHARED_RECOGNIZER):
        if (runs / name / "model").is_dir():
            save_recognizer(load_recognizer(runs / name / "model"), bundled / name)
            copy_record(runs / name / "model", bundled / name)
    if (runs / VISIBILITY / "model").is_dir():
        save_visibility(load_visibility(runs / VISIBILITY / "model"), bundled / VISIBILITY)
        copy_record(runs / VISIBILITY / "model", bundled / VISIBILITY)
    for name in ("", SHARED_RECOGNIZER):
        calibration = load_calibration(runs / name)
        if calibration is not None:
            save_calibration(calibration, bundled / name)


def copy_record(run: Path, target: Path) -> None:
    """Copy the record of a training, and that of the training that it started from, if it is there."""
    if not (run / "training.json").is_file():
        return
    record = json.loads((run / "training.json").read_text())
    first = Path(record.get("start_from") or "") / "training.json"
    if first.is_file():
        shutil.copy(first, target / FIRST_RECORD)
        record["start_from"] = f"the weights that {FIRST_RECORD} is the record of"
    (target / "training.json").write_text(json.dumps(record, indent=2) + "\n")


def make_database(infinigen: Path) -> None:
    """Starter database: shapes of the generator with an unused seed, and of infinigen's source split."""
    path = BUNDLED / "furniture.kpred"
    path.unlink(missing_ok=True)
    shapes = []
    for category in CATEGORIES:
        pack = MeshPack.load(infinigen / f"{category}.npz")
        made = generate(category, GENERATED, DATABASE_SEED, splits=False)
        pool = [(str(made.model_id[i]), made[i]) for i in range(len(made))]
        rows = np.random.default_rng(REDISTRIBUTED_SEED).permutation(pack.indices("source"))[:REDISTRIBUTED]
        pool += [(f"infinigen_{pack.model_id[i]}", pack[int(i)]) for i in rows]
        targets, weights = covered(category, pack)
        chosen = set(choose_models(pool, targets, weights, category, CHOSEN))
        for name, mesh in pool:
            source = "infinigen" if name.startswith("infinigen_") else "generator"
            shapes += [(name, category, source, mesh)] if name in chosen else []
    report = build_database(path, shapes, load_model())
    print(f"database: {report.added} models, {path.stat().st_size / 1e6:.1f} MB, failed {report.failed}")
    with Database.open(path) as database:
        print({category: len(database.model_ids(category)) for category in database.categories()})


def covered(category: str, pack: MeshPack) -> tuple[list[Mesh], np.ndarray]:
    """Shapes that the database shall explain, and their weights: generator and infinigen count alike."""
    made = generate(category, COVERED, COVERED_SEED, splits=False)
    rows = np.random.default_rng(5).permutation(pack.indices("train"))[: COVERED // 3]
    weights = [np.full(len(made), 0.5 / len(made)), np.full(len(rows), 0.5 / len(rows))]
    return [made[i] for i in range(len(made))] + [pack[int(i)] for i in rows], np.concatenate(weights)


def make_scan(infinigen: Path) -> None:
    """Two depth views of a chair that is in neither the database nor the training: metres, turned, with noise."""
    import trimesh

    pack = MeshPack.load(infinigen / "chair.npz")
    rows = [i for i in pack.indices("val") if str(pack.extra["factory"][i]) == "ChairFactory"]
    mesh = pack[int(rows[20])]
    generator = torch.Generator().manual_seed(3)
    vertices, faces = torch.from_numpy(mesh.vertices), torch.from_numpy(mesh.faces).long()
    cameras = torch.tensor([[1.6, 1.5, 2.0], [-2.2, 1.6, 0.8]])
    views = [depth_scan(vertices, faces, c, 3000, noise=0.006, dropout=0.05, generator=generator) for c in cameras]
    points = torch.cat(views).double().numpy()
    turn = np.radians(35)
    rotation = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    placed = points @ rotation.T + np.array([2.4, 0.0, -1.1])
    trimesh.PointCloud(placed).export(BUNDLED / "chair_scan.ply")


def write_cards(evaluations: Sequence[Path]) -> None:
    """Model cards: data, steps, seed, measured numbers."""
    rows = [row for evaluation in evaluations for row in json.loads(evaluation.read_text())["rows"]]
    for models, preset in ((BUNDLED / "model", "kp-red-plus"), (PAPER, "kp-red")):
        for category in CATEGORIES:
            folder = models / category
            card = [*_category_card(category, preset, folder), *_measured(category, preset, rows)]
            (folder / "README.md").write_text("\n".join(card))
    folder = BUNDLED / "model" / RECOGNIZER
    if folder.is_dir():
        (folder / "README.md").write_text("\n".join(_recognizer_card(folder)))
    loaders = {
        SHARED: load_network,
        f"{RECOGNIZER}/{SECOND}": load_recognizer,
        SHARED_RECOGNIZER: load_recognizer,
        VISIBILITY: load_visibility,
    }
    for name, load in loaders.items():
        if (BUNDLED / "model" / name / "README.md").is_file():
            update_card(BUNDLED / "model" / name, load(BUNDLED / "model" / name))


def update_card(folder: Path, network: nn.Module) -> None:
    """Bring the measured facts of a card that was written by hand up to date."""
    facts = {
        "file": f"{WEIGHTS_FILE}, half precision, {_megabytes(folder)} MB",
        "parameters": f"{sum(p.numel() for p in network.parameters()):,}",
    }
    if isinstance(network, KPRed):
        facts["fingerprint"] = f"`{network.fingerprint()}`"
    text = (folder / "README.md").read_text()
    for name, value in facts.items():
        text = re.sub(rf"^\| {name} \| .* \|$", f"| {name} | {value} |", text, flags=re.M)
    (folder / "README.md").write_text(text)


def _category_card(category: str, preset: str, folder: Path) -> list[str]:
    record = json.loads((folder / "training.json").read_text())
    network = load_network(folder)
    training, model = record["training"], network.config
    stages = [(name, training[name]) for name in record["stages"]]
    steps = ", ".join(f"{name} {stage['steps']}, {stage['batch']}" for name, stage in stages)
    options = " ".join(f"--{name}.steps {stage['steps']} --{name}.batch {stage['batch']}" for name, stage in stages)
    return [
        f"# kpred: {category}, {preset}",
        "",
        f"Networks of KP-RED for the category {category}: {model.keypoints} semantic keypoints, neural-cage influence,",
        "retrieval tokens, and their twins for partial scans. Coordinates: unit box, y up, front +z.",
        "",
        "| | |",
        "|---|---|",
        f"| fingerprint | `{network.fingerprint()}` |",
        f"| file | model.safetensors, half precision, {_megabytes(folder)} MB |",
        f"| parameters | {sum(p.numel() for p in network.parameters()):,} |",
        f"| trained on | {record['shapes']['targets']} shapes: this project's generator "
        f"(`kpred data generate {category} -n {record['shapes']['packs'][1]} --seed 31 --cuboids 0.5 --no-splits`) and "
        "infinigen (splits source and train); nothing else |",
        f"| steps, batch | {steps} |",
        f"| seed | {training['seed']} |",
        f"| command | `kpred train all INFINIGEN/{category}.npz GENERATED/{category}.npz --preset {preset} {options} "
        f"--ranking-weight {training['ranking_weight']} --device cuda`; here by scripts/train_within.py, which chose "
        "the steps to fit into nine minutes |",
        "| hardware | one H100, TF32, shared by seven trainings at once |",
        f"| cage, influence, keypoint head | {model.cage}, {model.influence}, {model.keypoint_head} |",
        "",
        "Shapes of infinigen are output of Infinigen 1.15.5 (generator code BSD-3-Clause).",
        "",
    ]


def _measured(category: str, preset: str, rows: list[dict[str, Any]]) -> list[str]:
    mine = [
        cell
        for cell in rows
        if cell["category"] == category and cell["model"] in (preset, "") and cell["unit"] == "unit box squared"
    ]
    if not mine:
        return []
    lines = [
        "## Measured",
        "",
        "`kpred evaluate table full`, split val; unit box squared, known unit box, mean over instances, best of 10.",
        "",
        "| data | n | method | CD | 95 % |",
        "|---|---|---|---|---|",
    ]
    for cell in mine:
        values = f"{cell['value']:.5f} | {cell['low']:.5f} to {cell['high']:.5f}"
        lines.append(f"| {cell['dataset']} | {cell['n']} | {cell['method']} | {values} |")
    return [*lines, ""]


def _recognizer_card(folder: Path) -> list[str]:
    record = json.loads((folder / "training.json").read_text())
    network, training = load_recognizer(folder), record["training"]
    numbers = ", ".join(f"{count} of {name}" for name, count in record["shapes"].items())
    steps = str(training["optimisation"]["steps"])
    if (folder / FIRST_RECORD).exists():
        first = json.loads((folder / FIRST_RECORD).read_text())["training"]["optimisation"]["steps"]
        steps = f"{first}, then {steps} more from the weights of the first (`--start-from`)"
    return [
        "# kpred: recognizer",
        "",
        f"Tells of a scan as it stands (y up) whether it is a {', '.join(network.config.categories)} that faces +z, or",
        "none of them, and the small turn that is missing. Any unit; whole or partial.",
        "",
        "| | |",
        "|---|---|",
        f"| file | model.safetensors, half precision, {_megabytes(folder)} MB |",
        f"| parameters | {sum(p.numel() for p in network.parameters()):,} |",
        f"| trained on | {numbers}: this project's generator (`kpred data generate CATEGORY -n 900 --seed 21 --cuboids "
        "0.4`, `kpred data generate other -n 1500 --seed 5`) and infinigen, splits source and train; nothing else |",
        f"| steps | {steps}; batch {training['optimisation']['batch']}, {training['points']} points |",
        f"| seed | {training['seed']} |",
        f"| command | `kpred train recognition INFINIGEN/*.npz GENERATED/*.npz --optimisation.steps "
        f"{training['optimisation']['steps']} --precision {training['precision']}` |",
        "| hardware | CPU, one thread |",
        "",
        "Shapes of infinigen are output of Infinigen 1.15.5 (generator code BSD-3-Clause).",
        "",
    ]


def _megabytes(folder: Path) -> str:
    return f"{(folder / 'model.safetensors').stat().st_size / 1e6:.1f}"


if __name__ == "__main__":
    main()
