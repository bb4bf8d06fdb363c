"""Objects of a raw room: up direction, floor, walls and ceiling, proposals, and which of them are furniture."""
