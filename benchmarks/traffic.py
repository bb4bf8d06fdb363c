"""What a piece of torch work costs at least: arithmetic, and bytes that its operations read and write."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves
from torch.utils.flop_counter import FlopCounterMode

from kpred.ops import nearest

OPERATIONS_A_PAIR = 9
"""Of the fused search for nearest neighbours: three differences, three products, two sums, and a comparison."""


@dataclass
class Cost:
    """Of one run.

    Attributes:
        products: floating-point operations of matrix products (a multiplication and an addition are two).
        pairs: pairs of points that the fused search compares.
        traffic: bytes that all operations read and write, each on its own: what caches hold is counted too.
        operations: how many operations are started.
    """

    products: float = 0.0
    pairs: float = 0.0
    traffic: float = 0.0
    operations: int = 0


class _Traffic(TorchDispatchMode):
    """Counts bytes of all operations that touch memory: views do not."""

    def __init__(self, cost: Cost) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.cost = cost

    def __torch_dispatch__(
        self, func: Any, types: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        result = func(*args, **(kwargs or {}))
        makes = func._schema.name in ("aten::empty", "aten::empty_strided", "aten::empty_like", "aten::new_empty")
        if not (func.is_view or makes):
            leaves = tree_leaves((args, kwargs, result))
            self.cost.traffic += sum(_bytes(leaf) for leaf in leaves if isinstance(leaf, Tensor))
            self.cost.operations += 1
        return result


def _bytes(tensor: Tensor) -> int:
    # What is expanded is read once.
    size = tensor.element_size()
    for length, stride in zip(tensor.shape, tensor.stride(), strict=True):
        size *= length if stride else 1
    return size


@contextmanager
def _searches(cost: Cost) -> Iterator[None]:
    """Count the operations of the fused search, which torch does not see."""
    found = nearest._fused

    def counting() -> Callable[[Tensor, Tensor], tuple[Tensor, Tensor]] | None:
        kernel = found()
        if kernel is None:
            return None

        def counted(query: Tensor, reference: Tensor) -> tuple[Tensor, Tensor]:
            distance, index = kernel(query, reference)
            cost.pairs += distance.numel() * reference.shape[1]
            cost.traffic += sum(_bytes(one) for one in (query, reference, distance, index))
            cost.operations += 1
            return distance, index

        return counted

    nearest._fused = counting  # type: ignore[assignment]
    try:
        yield
    finally:
        nearest._fused = found


def cost_of(work: Callable[[], object]) -> Cost:
    """Count one run."""
    cost = Cost()
    counter = FlopCounterMode(display=False)
    with _searches(cost), counter, _Traffic(cost):
        work()
    cost.products = float(counter.get_total_flops())
    return cost


@dataclass(frozen=True)
class Peaks:
    """What the device does at most, measured.

    Attributes:
        products: operations a second of a large matrix product, in the precision that the networks run in.
        plain: the same without tensor cores: what all else computes with.
        traffic: bytes a second of a large copy, read and written.
    """

    products: float
    plain: float
    traffic: float

    def seconds(self, cost: Cost) -> dict[str, float]:
        """Return the minimum time of the arithmetic and of the memory traffic, each on its own."""
        return {
            "arithmetic": cost.products / self.products + cost.pairs * OPERATIONS_A_PAIR / self.plain,
            "memory": cost.traffic / self.traffic,
        }


def peaks(device: torch.device, side: int = 8192) -> Peaks:
    """Measure a device with matrices of `side`, and with copies of as many numbers."""
    a, b = (torch.randn(side, side, device=device) for _ in range(2))
    wanted = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("highest")
    plain = 2 * side**3 / best_seconds(lambda: a @ b, device)
    torch.set_float32_matmul_precision(wanted)
    products = 2 * side**3 / best_seconds(lambda: a @ b, device)
    copied = 2 * a.numel() * 4 / best_seconds(lambda: b.copy_(a), device)
    return Peaks(products, plain, copied)


def best_seconds(work: Callable[[], object], device: torch.device, repeats: int = 5) -> float:
    """Measure the minimum time of a run, after a warm-up run; waits for the device."""
    return min(times(work, device, repeats))


def times(work: Callable[[], object], device: torch.device, repeats: int) -> list[float]:
    """Measure seconds of several runs, after a warm-up run; waits for the device."""
    import time

    work()
    found = []
    for _ in range(repeats):
        wait(device)
        began = time.perf_counter()
        work()
        wait(device)
        found.append(time.perf_counter() - began)
    return found


def wait(device: torch.device) -> None:
    """Wait until the device has finished its queue."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)
