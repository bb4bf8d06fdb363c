"""Infinigen's factories of indoor things by category, with how often each is drawn."""

from __future__ import annotations

FACTORIES: dict[str, dict[str, int]] = {
    "chair": {"ChairFactory": 500, "OfficeChairFactory": 150, "BarChairFactory": 150, "ArmChairFactory": 60},
    "table": {
        "TableDiningFactory": 400,
        "CoffeeTableFactory": 200,
        "SimpleDeskFactory": 150,
        "SideTableFactory": 100,
        "TableCocktailFactory": 100,
        "SidetableDeskFactory": 60,
    },
    "cabinet": {
        "SingleCabinetFactory": 300,
        "LargeShelfFactory": 200,
        "CellShelfFactory": 200,
        "SimpleBookcaseFactory": 150,
        "KitchenCabinetFactory": 100,
        "TVStandFactory": 80,
        "TriangleShelfFactory": 40,
        "WallShelfFactory": 40,
    },
    "sofa": {"SofaFactory": 1},
    "bed": {"BedFrameFactory": 3, "BedFactory": 1},
    "mattress": {"MattressFactory": 1},
    "kitchen_island": {"KitchenIslandFactory": 1},
    "fridge": {"BeverageFridgeFactory": 1},
    "dishwasher": {"DishwasherFactory": 1},
    "microwave": {"MicrowaveFactory": 1},
    "oven": {"OvenFactory": 1},
    "toaster": {"ToasterFactory": 1},
    "display": {"TVFactory": 1, "MonitorFactory": 1},
    "bathtub": {"BathtubFactory": 1},
    "sink": {"BathroomSinkFactory": 2, "StandingSinkFactory": 1},
    "toilet": {"ToiletFactory": 1},
    "lamp": {"DeskLampFactory": 1, "FloorLampFactory": 1, "CeilingClassicLampFactory": 1, "CeilingLightFactory": 1},
    "vase": {"VaseFactory": 1},
    "bottle": {"BottleFactory": 1},
    "plant": {"LargePlantContainerFactory": 1},
    "door": {"PanelDoorFactory": 1, "GlassPanelDoorFactory": 1, "LiteDoorFactory": 1, "LouverDoorFactory": 1},
    "window": {"WindowFactory": 1},
    "mirror": {"MirrorFactory": 1},
    "bowl": {"BowlFactory": 1},
    "pot": {"PotFactory": 1},
    "aquarium": {"AquariumTankFactory": 1},
}
"""Factories of each category, and how often each is drawn."""
