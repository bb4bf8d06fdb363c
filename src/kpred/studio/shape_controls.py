"""Controls of the shape: keypoints and their locks, refitting, sizes of parts, what is shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from kpred.errors import ConfigError
from kpred.studio.gestures import WHOLE, Axis, PinKeypoint, RefitRest, SetSize
from kpred.studio.state import State

if TYPE_CHECKING:
    from kpred.studio.page import Page

NONE = "none"
ANY = "any"
WHOLE_NAME = "whole object"
ROUNDED = 0.0051
"""Sizes are shown to so many centimetres; a smaller difference was not typed."""

SIDES: dict[str, Axis] = {"Width, cm": "x", "Height, cm": "y", "Depth, cm": "z"}
AXES = {"x (width)": "x", "y (height)": "y", "z (depth)": "z"}


class ShapeControls:
    """The tab `Shape` of a page."""

    def __init__(self, page: Page) -> None:
        self._page = page
        gui, state = page.client.gui, page.state
        count = len(state.shape.keypoints)
        self._keypoint = gui.add_dropdown("Keypoint", (NONE, *(str(number) for number in range(count))))
        self._keypoint.on_update(self._by_hand(lambda: page.select(self._chosen())))
        self._mirror = gui.add_checkbox("Mirror lock", False, hint="The keypoint on the other side moves alike")
        self._axis = gui.add_dropdown("Axis lock", (ANY, *AXES))
        self._axis.on_update(self._by_hand(lambda: page.refresh(keep_message=True)))
        self._pinned = gui.add_checkbox("Pinned", False)
        self._pinned.on_update(self._by_hand(self._pin))
        refit = gui.add_button("Refit the rest", hint="Pinned keypoints and typed sizes stay")
        refit.on_click(lambda _: page.do(RefitRest()))
        self._parts = gui.add_dropdown("Sizes of", (WHOLE_NAME,))
        self._parts.on_update(self._by_hand(lambda: page.refresh(keep_message=True)))
        self._sizes = {name: gui.add_number(name, 1.0, min=0.01, max=100_000.0, step=0.1) for name in SIDES}
        apply = gui.add_button("Set the sizes")
        apply.on_click(lambda _: self._set_sizes())
        self._layers = [gui.add_checkbox(name, True) for name in ("Scan", "Result", "Keypoints")]
        for layer in self._layers:
            layer.on_update(self._by_hand(self.show_layers))
        opacity = gui.add_slider("Opacity of the result", 0.1, 1.0, 0.05, 1.0)
        opacity.on_update(lambda _: page.view.set_opacity(float(opacity.value)))

    @property
    def mirror(self) -> bool:
        """Whether the keypoint on the other side moves alike."""
        return bool(self._mirror.value)

    @property
    def axis(self) -> Axis | None:
        """The only axis that keypoints are dragged along."""
        return cast("Axis | None", AXES.get(self._axis.value))

    @property
    def part(self) -> int:
        """The part whose sizes are shown; `WHOLE`: the object."""
        name = str(self._parts.value)
        return WHOLE if name == WHOLE_NAME else int(name.removeprefix("part ").split()[0]) - 1

    def refresh(self, state: State) -> None:
        """Show the state's keypoint, part and sizes."""
        keypoint = self._page.keypoint
        self._keypoint.value = NONE if keypoint is None else str(keypoint)
        self._pinned.value = keypoint in state.pins
        names = self._names(state)
        if tuple(self._parts.options) != names:
            self._parts.options = names
        try:
            sizes = state.part_sizes(self.part) * state.fit.unit.metres * 100.0
        except ConfigError:
            return
        for size, control in zip(sizes, self._sizes.values(), strict=True):
            control.value = round(float(size), 2)

    def show_layers(self) -> None:
        """Show the layers that are ticked."""
        scan, result, keypoints = (bool(layer.value) for layer in self._layers)
        self._page.view.show_layers(scan, result, keypoints)

    def _names(self, state: State) -> tuple[str, ...]:
        if state.fit.source.step in ("free", "paper"):
            return (WHOLE_NAME,)
        structure = state.fit.placed.entry.structure
        parts = []
        for part in range(structure.parts):
            other = int(structure.mirrored_parts[part])
            parts.append(f"part {part + 1}" + (f" (alike: {other + 1})" if other not in (-1, part) else ""))
        return (WHOLE_NAME, *parts)

    def _chosen(self) -> int | None:
        return None if self._keypoint.value == NONE else int(self._keypoint.value)

    def _pin(self) -> None:
        if self._page.keypoint is not None:
            self._page.do(PinKeypoint(self._page.keypoint, bool(self._pinned.value)))

    def _set_sizes(self) -> None:
        """Set each side that was typed over; the others follow."""
        state, part = self._page.state, self.part
        centimetre = state.fit.unit.metres * 100.0
        # Before the first is set: after it, the page shows sizes anew.
        typed = {axis: float(self._sizes[name].value) for name, axis in SIDES.items()}
        for (axis, length), now in zip(typed.items(), state.part_sizes(part) * centimetre, strict=True):
            if abs(length - float(now)) > ROUNDED:
                self._page.do(SetSize(part, axis, length / centimetre))

    def _by_hand(self, action: Any) -> Any:
        """Make a callback that leaves out values which the page itself sets: those come without a client."""

        def changed(event: Any) -> None:
            if event.client is not None:
                action()

        return changed
