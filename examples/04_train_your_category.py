"""Train networks for a category, here in half a minute and far too short to be of use.

    python examples/04_train_your_category.py [output folder]

The steps are those of a real training, with other numbers: thousands of shapes and 10,000 steps a stage
(`kpred train all PACK -o RUN` does the same from the command line, with progress and exact resume).
"""

import sys
from pathlib import Path

from kpred import load_model
from kpred.nn import ModelConfig
from kpred.shapes import MeshPack
from kpred.synthetic.generator import generate
from kpred.training.config import StageConfig, TrainConfig
from kpred.training.run import train

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("kpred-examples")
folder.mkdir(parents=True, exist_ok=True)

# 1. Shapes: a mesh pack with the splits source, train and val. Yours may come from a folder of meshes:
#    MeshPack.from_meshes([read_mesh(path) for path in paths], model_ids, splits, category="lamp").save("lamp.npz")
generate("cabinet", 24, seed=0).save(folder / "cabinet.npz")
pack = MeshPack.load(folder / "cabinet.npz")

# 2. Settings. ModelConfig(category=...) alone is the default network; this one is smaller.
network_config = ModelConfig(category="cabinet", width=32, token_size=16, region_points=16, stages=1)
short = StageConfig(steps=8, batch=4)
train_config = TrainConfig(deformation=short, retrieval=short, partial=short, points=256, keypoint_points=128, warmup=4)

# 3. Three stages: keypoints and deformation; retrieval tokens; partial scans. Checkpoints, TensorBoard events and, at
#    the end, the weights (config.json and model.safetensors) go to the run folder. A stopped run goes on from there.
run = folder / "cabinet_run"


def report(stage: str, step: int, steps: int, losses: dict[str, float]) -> None:
    """Print the first and the last step of each stage."""
    if step in (1, steps):
        print(f"{stage:<12} {step:>3} / {steps}", {name: round(value, 3) for name, value in losses.items()})


train([pack], network_config, train_config, run, report=report)

# 4. The trained model is a folder; kpred.fit, build_database and evaluate take it as `model`.
model = load_model(run / "model")
print(f"{run / 'model'}: {', '.join(model.categories)}, weights {model['cabinet'].fingerprint()}")
