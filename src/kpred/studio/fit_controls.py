"""Controls of the fit: other models, category, up axis, front, deform mode, unit, crop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, get_args

from kpred.ops.rotations import UP_AXES
from kpred.refinement.config import Deform
from kpred.shapes.unit_name import UNIT_NAMES
from kpred.studio.gestures import (
    AUTO,
    ChooseCategory,
    ChooseDeform,
    ChooseModel,
    ChooseUnit,
    ChooseUp,
    Gesture,
    Turn,
)
from kpred.studio.scene_view import CropBox
from kpred.studio.state import State
from kpred.studio.thumbnails import COLUMNS

if TYPE_CHECKING:
    from kpred.studio.page import Page

TURNS = {
    "Turn the front": {"-90°": -90.0, "180°": 180.0, "+90°": 90.0},
    "A little": {"-5°": -5.0, "-1°": -1.0, "+1°": 1.0, "+5°": 5.0},
}


class FitControls:
    """The tab `Fit` of a page."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self.box: CropBox | None = None
        gui, state = page.client.gui, page.state
        self._sheet = gui.add_image(page.sheet(state), label="Models found", format="png")
        numbers = [str(number + 1) for number in range(len(state.candidates))]
        for first in range(0, len(numbers), COLUMNS):
            self._add_models(numbers[first : first + COLUMNS])
        categories = state.context.model.categories
        self._category = self._choice("Category", (AUTO, *categories), lambda name: ChooseCategory(name))
        self._up = self._choice("Up axis", (AUTO, *UP_AXES), lambda name: ChooseUp(name))
        for label, turns in TURNS.items():
            self._add_turns(label, turns)
        self._deform = self._choice("Deform", get_args(Deform), lambda name: ChooseDeform(name))
        self._unit = self._choice("Unit of the scan", (AUTO, *UNIT_NAMES), lambda name: ChooseUnit(name))
        self._boxed = gui.add_checkbox("Box of a crop", False, hint="Drag the two corners, then crop")
        self._boxed.on_update(lambda event: self._show_box() if event.client is not None else None)
        crop = gui.add_button("Crop the scan and fit again")
        crop.on_click(lambda _: page.crop())

    def refresh(self, state: State) -> None:
        """Show the state's choices."""
        page = self._page
        self._sheet.image = page.sheet(state)
        options = state.options
        categories = state.context.categories
        self._category.value = categories[0] if len(categories) == 1 else AUTO
        self._up.value, self._deform.value, self._unit.value = options.up, options.deform, options.unit
        if self._boxed.value:
            self._boxed.value = False
            self.box = page.view.show_box(state, False)

    def _add_models(self, numbers: list[str]) -> None:
        """Add the buttons of one row of thumbnails."""
        buttons = self._page.client.gui.add_button_group("Use model" if numbers[0] == "1" else "or", numbers)
        buttons.on_click(lambda _: self._use(int(buttons.value) - 1))

    def _add_turns(self, label: str, turns: dict[str, float]) -> None:
        buttons = self._page.client.gui.add_button_group(label, tuple(turns))
        buttons.on_click(lambda _: self._page.do(Turn(turns[buttons.value])))

    def _use(self, rank: int) -> None:
        candidates = self._page.state.candidates
        if rank < len(candidates):
            self._page.do(ChooseModel(candidates[rank].model_id))

    def _show_box(self) -> None:
        self.box = self._page.view.show_box(self._page.state, self._boxed.value)

    def _choice(self, label: str, options: tuple[str, ...], gesture: Any) -> Any:
        control = self._page.client.gui.add_dropdown(label, options)

        def chosen(event: Any) -> None:
            # Values that the page itself sets come without a client.
            if event.client is not None:
                made: Gesture = gesture(control.value)
                self._page.do(made)

        control.on_update(chosen)
        return control
