"""Train the two networks of detection on virtual rooms; a few minutes on a processor.

    kpred data rooms -n 240 --seed 504 --packs INFINIGEN/*.npz --points 50000 -o rooms.npz
    python scripts/train_detection.py rooms.npz [...] -o src/kpred/bundled/detector --examples examples.npz

Rooms are turned by random yaws; every second is thinned at random; what stands in a cabinet is part of it. The pair
network learns from all rooms, and so does the proposal network, by proposals that the pair network makes, several times
in other yaws. What the proposal network learns from is kept in the file of examples, and the output is written every
minute: a run that was stopped goes on with `--start-from OUTPUT`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from kpred.detection.crops import OWN_POINTS, proposal_crops
from kpred.detection.networks import CATEGORIES, Detector
from kpred.detection.propose import PreparedRoom, pair_odds, prepare_room, propose_objects, room_links
from kpred.evaluation.rooms.virtual import room_rotation, upright_room
from kpred.synthetic.rooms.pack import RoomPack

MIN_SEEN = 60
"""Voxels of an object that must be seen for a proposal to be for it."""

MEETING, OTHERS = 70, 60
"""Proposals a room that meet an object, and that do not, drawn at random."""

RIGHT, WRONG = 0.5, 0.35
"""IoU of a proposal from which it has its object's category, and below which it has none."""


STRETCH, BLIND = (0.12, 0.12, 0.05), 0.15
"""Standard deviations of the logarithm of stretches along the sides and up, and fraction of proposals whose affinities
are hidden, in training.
"""

NAMES = ("clouds", "facts", "iou", "category")


@dataclass(frozen=True, eq=False)
class Labelled:
    """A prepared room with the object of each voxel, -1 for none, and the objects' categories."""

    room: PreparedRoom
    owner: np.ndarray
    categories: np.ndarray

    def table(self) -> np.ndarray:
        """Count voxels of each piece (rows) on each object (columns, the first for none)."""
        assert self.room.pieces is not None
        rest = self.room.voxels.segment >= 0
        wide = len(self.categories) + 1
        code = self.room.voxels.segment[rest] * wide + self.owner[rest] + 1
        return np.bincount(code, minlength=len(self.room.pieces.sizes) * wide).reshape(-1, wide)

    def pair_labels(self) -> np.ndarray:
        """Tell for each pair of pieces whether most voxels of both are of one object."""
        main = self.table().argmax(axis=1) - 1
        one, other = main[self.room.pairs[:, 0]], main[self.room.pairs[:, 1]]
        return np.asarray((one == other) & (one >= 0))

    def overlaps(self, proposals: list[frozenset[int]]) -> tuple[np.ndarray, np.ndarray]:
        """Return IoU (P,) of each proposal with the piece of furniture it meets best, and that one's category (P,)."""
        assert self.room.pieces is not None
        chosen = np.zeros((len(proposals), len(self.room.pieces.sizes)))
        for row, pieces in enumerate(proposals):
            chosen[row, list(pieces)] = 1.0
        inside = (chosen @ self.table())[:, 1:]
        whole = np.bincount(self.owner + 1, minlength=len(self.categories) + 1)[1:]
        iou = inside / ((chosen @ self.room.pieces.sizes)[:, None] + whole - inside)
        iou[:, ~np.isin(self.categories, CATEGORIES) | (whole < MIN_SEEN)] = 0.0
        best = iou.argmax(axis=1)
        return iou.max(axis=1), self.categories[best]


def labelled_rooms(files: list[Path], number: int = 0) -> Iterator[Labelled]:
    """Prepare all rooms, one after the other; every pass `number` turns and thins them in another way."""
    for file in files:
        pack = RoomPack.load(file)
        for index in range(len(pack)):
            rng = np.random.default_rng([index, 7, number])
            yaw = float(rng.uniform(0, 2 * np.pi))
            points, instance, objects = upright_room(pack, index, yaw)
            room_turn = room_rotation(yaw)
            instance = with_contents(pack, points, instance, objects, room_turn)
            if (index + number) % 2 == 0:
                kept = np.sort(rng.permutation(len(points))[: int(rng.uniform(15_000, 40_000))])
                points, instance = points[kept], instance[kept]
            room = prepare_room(points)
            if room.pieces is not None:
                yield Labelled(room, voxel_owner(room.grid.owner, instance, len(room.grid)), pack.category[objects])


def with_contents(
    pack: RoomPack, points: np.ndarray, instance: np.ndarray, objects: slice, turn: np.ndarray
) -> np.ndarray:
    """Return instances (N,) where small things in a cabinet's box belong to the cabinet."""
    result = instance.copy()
    small = (pack.category[objects] == "other") & (pack.surface_row[objects] < 0)
    loose = np.flatnonzero((instance >= 0) & small[instance])
    for row in np.flatnonzero(pack.category[objects] == "cabinet"):
        pose, (low, high) = pack.pose[objects][row].astype(np.float64), pack.box[objects][row]
        local = (points[loose] @ turn - pose[:3, 3]) @ pose[:3, :3]
        result[loose[((local > low) & (local < high)).all(axis=1)]] = row
    return result


def voxel_owner(owner: np.ndarray, instance: np.ndarray, count: int) -> np.ndarray:
    """Return the object (count,) that most points of each voxel are on, -1 for none."""
    wide = int(instance.max()) + 2
    code, votes = np.unique(owner * wide + instance + 1, return_counts=True)
    order = np.lexsort((votes, code // wide))
    result = np.full(count, -1, dtype=np.int64)
    result[code[order] // wide] = code[order] % wide - 1  # The last assignment, the most votes, counts.
    return result


def train_pairs(detector: Detector, rooms: list[Labelled], epochs: int, fresh: bool) -> None:
    """Train the pair network on the pairs of these rooms; a fresh one learns the features' scales first."""
    features = torch.from_numpy(np.concatenate([one.room.features for one in rooms])).float()
    labels = torch.from_numpy(np.concatenate([one.pair_labels() for one in rooms])).float()
    network = detector.pairs.train()
    if fresh:
        network.mean.copy_(features.mean(0))
        network.deviation.copy_(features.std(0) + 1e-3)
    steps = epochs * (len(features) // 256 + 1)
    optimizer = torch.optim.AdamW(network.parameters(), 2e-3, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 2e-3, total_steps=steps)
    for _ in range(epochs):
        for rows in torch.randperm(len(features)).split(256):
            loss = functional.binary_cross_entropy_with_logits(network(features[rows]), labels[rows])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
    network.eval()
    with torch.no_grad():
        right = ((network(features) > 0) == (labels > 0)).float().mean()
    print(f"pairs: {len(features)}, right {float(right):.3f} (always the likelier: {float(labels.mean()):.3f})")


@dataclass(frozen=True, eq=False)
class Examples:
    """Clouds of proposals (P, points, channels) and facts (P, facts), their best IoU (P,) and category (P,)."""

    clouds: Tensor
    facts: Tensor
    iou: Tensor
    category: Tensor


def examples(detector: Detector, rooms: Iterable[Labelled], seed: int = 0) -> Examples:
    """Sample proposals of all rooms."""
    parts = []
    for number, one in enumerate(rooms):
        rng = np.random.default_rng([number, 3, seed])
        odds = pair_odds(one.room, detector.pairs)
        proposals = sorted(propose_objects(one.room, odds), key=sorted)
        iou, names = one.overlaps(proposals)
        order = rng.permutation(len(iou))
        meets = iou[order] > 0.2
        rows = np.concatenate([order[meets][:MEETING], order[~meets][:OTHERS]])
        links = room_links(one.room, odds)
        clouds, facts = proposal_crops(one.room.voxels, links, [proposals[row] for row in rows], number)
        category = np.array(
            [CATEGORIES.index(name) if name in CATEGORIES else -1 for name in names[rows]], dtype=np.int64
        )
        parts.append((clouds.astype(np.float16), facts, iou[rows], category))
    clouds, facts, iou, category = (torch.from_numpy(np.concatenate(column)) for column in zip(*parts, strict=True))
    return Examples(clouds, facts.float(), iou.float(), category)


def joined(parts: Sequence[Examples]) -> Examples:
    """Join examples, in order."""
    return Examples(*(torch.cat([getattr(part, name) for part in parts]) for name in NAMES))


def train_proposals(detector: Detector, data: Examples, seconds: float, output: Path, rate: float = 2e-3) -> None:
    """Train the proposal network for so long; write it every minute."""
    network, batch = detector.proposals.train(), 64
    optimizer = torch.optim.AdamW(network.parameters(), rate, weight_decay=1e-2)
    started, step, losses, written = time.process_time(), 0, [0.0], time.monotonic()
    while (done := (time.process_time() - started) / seconds) < 1.0:
        for group in optimizer.param_groups:
            group["lr"] = rate * min(1.0, step / 100) * (1.0 - done) ** 1.2
        rows = torch.randint(len(data.iou), (batch,))
        scale = torch.exp(torch.tensor(STRETCH) * torch.randn(batch, 3))
        logits, quality = network(varied(data.clouds[rows].float(), scale), varied_facts(data.facts[rows], scale))
        iou = data.iou[rows]
        target = torch.where((iou >= RIGHT) & (data.category[rows] >= 0), data.category[rows], len(CATEGORIES))
        certain = (iou >= RIGHT) | (iou < WRONG)
        loss = (functional.cross_entropy(logits, target, reduction="none") * certain).mean()
        loss = loss + 2.0 * functional.binary_cross_entropy_with_logits(quality, iou)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        step += 1
        losses.append(float(loss.detach()))
        if step % 500 == 0:
            print(f"step {step}: loss {np.mean(losses[-500:]):.3f}, {done:.0%} of the time", flush=True)
        if time.monotonic() - written > 60.0:
            detector.save(output)
            written = time.monotonic()
    network.eval()


def varied(clouds: Tensor, scale: Tensor) -> Tensor:
    """Scale by (batch, 3), turn by quarters and a little, mirror and jitter clouds, and drop points."""
    count = len(clouds)
    angle = torch.randint(0, 4, (count,)) * (torch.pi / 2) + 0.12 * torch.randn(count)
    cosine, sine = angle.cos(), angle.sin()
    flip = torch.where(torch.rand(count) < 0.5, -1.0, 1.0)
    turn = torch.stack([torch.stack([cosine, -sine * flip], 1), torch.stack([sine, cosine * flip], 1)], 1)
    plan = torch.einsum("bij,bnj->bni", turn, clouds[:, :, :2] * scale[:, None, :2])
    height = clouds[:, :, 2:3] * scale[:, None, 2:]
    place = torch.cat([plan, height], dim=2)
    place = place + 0.008 * torch.randn_like(place)
    twice = torch.stack([(2 * angle).cos(), (2 * angle).sin()], 1)[:, None]
    a, b = clouds[:, :, 7], clouds[:, :, 8] * flip[:, None]
    facing = torch.stack([twice[..., 0] * a - twice[..., 1] * b, twice[..., 1] * a + twice[..., 0] * b], dim=2)
    noise = 0.15 * torch.randn(count, clouds.shape[1], 1) * (clouds[:, :, 9:] != 0)
    bond = (clouds[:, :, 9:] + noise).clamp(-1.0, 1.0) * (torch.rand(count, 1, 1) > BLIND)
    changed = torch.cat([place, clouds[:, :, 3:7], facing, bond], dim=2)
    kept = torch.rand(count, clouds.shape[1], 1) > 0.3 * torch.rand(count, 1, 1)
    first = torch.cat([changed[:, :1].expand(-1, OWN_POINTS, -1), changed[:, OWN_POINTS:]], dim=1)
    return torch.where(kept, changed, first)


def varied_facts(facts: Tensor, scale: Tensor) -> Tensor:
    """Scale facts of proposals as the clouds are scaled, jitter them, and leave out some affinities."""
    sides = facts[:, 1:3] * scale[:, :2]
    heights = facts[:, 3:5] * scale[:, 2:]
    grown = scale[:, :2].log().sum(dim=1, keepdim=True)
    bonds = facts[:, 7:] * (torch.rand(len(facts), 1) > BLIND)
    changed = torch.cat([facts[:, :1] + grown / 10, sides, heights, facts[:, 5:7], bonds], dim=1)
    return changed + 0.05 * torch.randn_like(facts)


def main() -> None:
    """Parse the command line, train, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=400.0, help="processor time of the proposal network")
    parser.add_argument("--passes", type=int, default=2, help="times that the rooms are turned, thinned and cut")
    parser.add_argument("--examples", type=Path, help="file of what the proposal network learns from, kept")
    parser.add_argument("--start-from", type=Path, help="a detector to go on from, at half the rate")
    options = parser.parse_args()
    torch.manual_seed(0)
    detector = Detector() if options.start_from is None else Detector.load(options.start_from).requires_grad_(True)
    if options.examples is not None and options.examples.is_file():
        with np.load(options.examples) as stored:
            data = Examples(*(torch.from_numpy(stored[name]) for name in NAMES))
    else:
        started = time.process_time()
        rooms = list(labelled_rooms(options.rooms))
        print(f"{len(rooms)} rooms prepared in {time.process_time() - started:.0f} s", flush=True)
        train_pairs(detector, rooms, 8, fresh=options.start_from is None)
        detector.save(options.output)
        first = examples(detector, rooms)
        del rooms  # Some megabytes each.
        passes = range(1, options.passes)
        more = [examples(detector, labelled_rooms(options.rooms, number), number) for number in passes]
        data = joined([first, *more])
        if options.examples is not None:
            np.savez(options.examples, **{name: getattr(data, name).numpy() for name in NAMES})
    print(f"{len(data.iou)} proposals, {int((data.iou >= RIGHT).sum())} with an object", flush=True)
    train_proposals(detector, data, options.seconds, options.output, 2e-3 if options.start_from is None else 1e-3)
    detector.save(options.output)


if __name__ == "__main__":
    main()
