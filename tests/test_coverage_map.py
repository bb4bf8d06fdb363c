"""Every source file has a test of its own name (`src/kpred/x/y.py`: `tests/x/test_y.py`) or is listed here beside the
tests that cover it."""

from __future__ import annotations

from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
SOURCE = TESTS.parent / "src" / "kpred"

COVERED_BY = {
    "_lazy.py": "test_light_imports.py",
    "_version.py": "cli/test_main.py",
    "errors.py": "cli/test_bad_input.py",
    "batch/*.py": "batch/test_batch.py",
    "batch/ray_*.py": "batch/test_ray.py",
    "bench/*.py": "cli/test_bench.py",
    "cli/command.py": "cli/test_main.py",
    "cli/compile.py": "cli/test_main.py",
    "cli/data*.py": "cli/test_main.py",
    "cli/database*.py": "cli/test_database_copy.py",
    "cli/demo.py": "cli/test_main.py",
    "cli/devices.py": "cli/test_main.py",
    "cli/evaluate_*.py": "cli/test_evaluate_tables.py",
    "cli/evaluate_peers.py": "peers/test_commands.py",
    "cli/evaluate_catalogue.py": "cli/test_evaluate.py",
    "cli/evaluate_real.py": "cli/test_evaluate.py",
    "cli/evaluate_scans.py": "cli/test_evaluate.py",
    "reports/batch_tile.py": "reports/test_batch_report.py",
    "cli/fit_files.py": "cli/test_overwrite.py",
    "cli/fit_many.py": "batch/test_batch.py",
    "cli/info.py": "cli/test_main.py",
    "cli/pack_files.py": "cli/test_files.py",
    "cli/plot.py": "evaluation/test_plots.py",
    "cli/process*.py": "cli/test_main.py",
    "cli/progress.py": "cli/test_output.py",
    "cli/table_options.py": "cli/test_evaluate_tables.py",
    "cli/train*.py": "cli/test_main.py",
    "cli/train_peer.py": "peers/test_commands.py",
    "cli/scan_options.py": "cli/test_evaluate.py",
    "cli/usage.py": "cli/test_depth.py",
    "database/*.py": "database/test_database.py",
    "database/token_codes*.py": "database/test_token_table.py",
    "database/encoders.py": "database/test_build.py",
    "database/migrations/*.py": "database/test_postgres.py",
    "database/point_faces.py": "database/test_update.py",
    "database/postgres_schema.py": "database/test_postgres.py",
    "database/sqlite.py": "database/test_faults.py",
    "database/structure_arrays.py": "database/test_surface.py",
    "database/token_file.py": "database/test_token_table.py",
    "datasets/*.py": "datasets/test_datasets.py",
    "datasets/infinigen/*.py": "datasets/test_infinigen.py",
    "evaluation/*.py": "evaluation/tables/test_make_table.py",
    "datasets/sweethome3d/*.py": "datasets/sweethome3d/test_catalogue.py",
    "evaluation/page.py": "evaluation/tables/test_pages.py",
    "evaluation/remarks.py": "evaluation/scans/test_run.py",
    "evaluation/methods/*.py": "evaluation/tables/test_scorer.py",
    "evaluation/metrics/cleanliness_measures.py": "evaluation/tables/test_scorer.py",
    "evaluation/metrics/cloud_errors.py": "evaluation/methods/test_no_learning.py",
    "evaluation/metrics/metric.py": "evaluation/tables/test_scorer.py",
    "evaluation/metrics/summary.py": "evaluation/scans/test_virtual_scans.py",
    "evaluation/metrics/surfaces.py": "evaluation/tables/test_make_table.py",
    "evaluation/plots/*.py": "evaluation/test_plots.py",
    "evaluation/scans/*.py": "evaluation/scans/test_virtual_scans.py",
    "evaluation/scans/*_pages.py": "cli/test_evaluate.py",
    "evaluation/scans/real.py": "cli/test_evaluate.py",
    "evaluation/scans/summary_table.py": "cli/test_evaluate.py",
    "evaluation/scans/catalogue_outcomes.py": "evaluation/scans/test_catalogue.py",
    "evaluation/scans/catalogue_summaries.py": "evaluation/scans/test_catalogue.py",
    "evaluation/scans/scenes.py": "evaluation/scans/test_real_crops.py",
    "evaluation/tables/*.py": "evaluation/tables/test_make_table.py",
    "evaluation/tables/*_pages.py": "evaluation/tables/test_pages.py",
    "evaluation/tables/page_parts.py": "evaluation/tables/test_pages.py",
    "evaluation/tables/packs.py": "evaluation/tables/test_scorer.py",
    "exports/bodies.py": "exports/test_mjcf.py",
    "exports/furniture.py": "exports/test_glb.py",
    "exports/glb_join.py": "exports/test_glb.py",
    "exports/libraries.py": "exports/test_formats.py",
    "exports/link_meshes.py": "exports/test_urdf.py",
    "exports/surfaces.py": "exports/test_usd.py",
    "exports/writer.py": "exports/test_formats.py",
    "exports/xml_text.py": "exports/test_sdf.py",
    "fitting/*.py": "fitting/test_pipeline.py",
    "fitting/refit.py": "cli/test_refit.py",
    "fitting/source.py": "fitting/test_record.py",
    "fitting/warnings.py": "fitting/test_confidence.py",
    "nn/*.py": "nn/test_model.py",
    "nn/fingerprint.py": "cli/test_refit.py",
    "ops/*_cpu.py": "ops/test_nearest_blocks.py",
    "ops/typing.py": "test_light_imports.py",
    "peers/methods/*.py": "peers/test_commands.py",
    "peers/networks/*.py": "peers/test_networks.py",
    "peers/training/*.py": "peers/test_training.py",
    "pose/*.py": "pose/test_estimators.py",
    "preprocessing/*.py": "preprocessing/test_clean.py",
    "refinement/*.py": "refinement/test_structure_reference.py",
    "refinement/*config.py": "refinement/test_bad_input.py",
    "refinement/freedom.py": "refinement/test_structure_map.py",
    "refinement/placement_cpu.py": "refinement/test_placement.py",
    "rendering/*.py": "rendering/test_picture.py",
    "scenes/*.py": "scenes/test_scene.py",
    "shapes/*.py": "shapes/test_hostile.py",
    "shapes/appearance/*.py": "shapes/appearance/test_appearance.py",
    "shapes/credit.py": "fitting/test_export.py",
    "shapes/upright_mesh.py": "shapes/test_folder_manifest.py",
    "shapes/formats/*.py": "shapes/test_mesh_variants.py",
    "shapes/formats/scan_*.py": "shapes/test_scan_variants.py",
    "shapes/structure/*.py": "shapes/structure/test_cleanliness.py",
    "rendering/thumbnail.py": "studio/test_thumbnails.py",
    "reports/fit_files.py": "server/test_worker.py",
    "server/form.py": "server/test_app.py",
    "server/job.py": "server/test_worker.py",
    "server/page.py": "server/test_app.py",
    "server/run.py": "cli/test_serve.py",
    "shapes/unit_name.py": "shapes/test_unit.py",
    "exports/format_table.py": "exports/test_formats.py",
    "studio/apply.py": "studio/test_session.py",
    "studio/editable.py": "studio/test_session.py",
    "studio/limits.py": "studio/test_structure_shape.py",
    "studio/fit_controls.py": "studio/test_browser.py",
    "studio/page.py": "studio/test_browser.py",
    "studio/room_page.py": "studio/test_browser.py",
    "studio/room_view.py": "studio/test_browser.py",
    "studio/scene_view.py": "studio/test_browser.py",
    "studio/serve.py": "studio/test_browser.py",
    "studio/shape_controls.py": "studio/test_browser.py",
    "studio/refit.py": "studio/test_structure_shape.py",
    "studio/shape.py": "studio/test_structure_shape.py",
    "studio/state.py": "studio/test_session.py",
    "studio/tabs.py": "studio/test_browser.py",
    "synthetic/*.py": "synthetic/test_generator.py",
    "synthetic/*/*.py": "synthetic/test_families.py",
    "synthetic/coarse/*.py": "synthetic/test_coarse.py",
    "synthetic/furnishings/*.py": "synthetic/test_furnishings.py",
    "synthetic/others/*.py": "synthetic/test_others.py",
    "synthetic/rooms/*.py": "synthetic/rooms/test_rooms.py",
    "training/*.py": "training/test_run.py",
    "training/recognition_*.py": "training/test_recognition.py",
    "training/dense_clouds.py": "training/test_visibility.py",
    "training/single_stage.py": "training/test_losses.py",
    "training/single_stage_run.py": "training/test_recognition.py",
    "training/visibility_*.py": "training/test_visibility.py",
    "training/visibility_crops.py": "training/test_room_crops.py",
}
"""Pattern of source files without a test of their name -> the test that covers them; a later line stands over an
earlier one."""


def _without_own_test() -> Iterator[str]:
    for file in sorted(SOURCE.rglob("*.py")):
        name = file.relative_to(SOURCE)
        if not name.stem.startswith("__") and not (TESTS / name.parent / f"test_{name.stem}.py").exists():
            yield str(name)


def _covering(name: str) -> str | None:
    """The test of the last pattern in the same folder that matches."""
    found = [test for pattern, test in COVERED_BY.items() if _matches(name, pattern)]
    return found[-1] if found else None


def _matches(name: str, pattern: str) -> bool:
    return name.count("/") >= pattern.count("/") and fnmatch(name, pattern)


def test_every_source_file_is_covered() -> None:
    assert [name for name in _without_own_test() if _covering(name) is None] == []


@pytest.mark.parametrize("pattern", COVERED_BY)
def test_every_entry_is_needed_and_names_a_test(pattern: str) -> None:
    assert (TESTS / COVERED_BY[pattern]).is_file()
    assert any(_covering(name) == COVERED_BY[pattern] for name in _without_own_test() if _matches(name, pattern))
