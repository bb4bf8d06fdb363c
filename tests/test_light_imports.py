"""Laws of importing: `import kpred` is cheap, and training needs only torch, numpy and safetensors."""

import subprocess
import sys
import textwrap

import pytest

# Stands before every import of the child process and hides each installed package but those that torch, numpy and
# safetensors need themselves.
_ONLY_TORCH = textwrap.dedent(
    """
    import importlib.metadata, re, sys

    def needs(name, seen):
        key = re.sub(r"[-_.]+", "-", name).lower()
        if key in seen:
            return seen
        try:
            wanted = importlib.metadata.requires(key) or []
        except importlib.metadata.PackageNotFoundError:
            return seen
        seen.add(key)
        for line in wanted:
            if "extra ==" not in line:
                needs(re.match(r"[A-Za-z0-9_.-]+", line).group(), seen)
        return seen

    allowed = set()
    for name in ("torch", "numpy", "safetensors"):
        needs(name, allowed)
    hidden = {
        module
        for module, owners in importlib.metadata.packages_distributions().items()
        if module != "kpred" and not any(re.sub(r"[-_.]+", "-", o).lower() in allowed for o in owners)
    }
    assert {"trimesh", "scipy", "jaxtyping", "tyro", "sqlalchemy"} <= hidden, hidden

    class Hide:
        def find_spec(self, name, path=None, target=None):
            if name.partition(".")[0] in hidden:
                raise ModuleNotFoundError(f"{name} is hidden in this test", name=name)
            return None

    sys.meta_path.insert(0, Hide())
    """
)


def _python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize(
    "module",
    [
        "kpred.errors",
        "kpred.ops",
        "kpred.nn",
        "kpred.shapes.mesh",
        "kpred.shapes.pack",
        "kpred.training",
    ],
)
def test_imports_with_only_torch_numpy_and_safetensors(module: str) -> None:
    done = _python(f"{_ONLY_TORCH}\nimport {module}\n")
    assert done.returncode == 0, done.stderr


def test_the_blocker_blocks() -> None:
    done = _python(f"{_ONLY_TORCH}\nimport trimesh\n")
    assert done.returncode != 0
    assert "hidden in this test" in done.stderr


@pytest.mark.parametrize("module", ["kpred", "kpred.cli.main"])
def test_import_loads_no_heavy_package(module: str) -> None:
    heavy = ["torch", "numpy", "scipy", "trimesh", "sqlalchemy", "pyvista", "numba", "huggingface_hub"]
    done = _python(f"import sys, {module}; print([m for m in {heavy} if m in sys.modules])")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


def test_the_public_face_is_complete() -> None:
    import kpred

    assert kpred.fit.__module__ == "kpred.fitting.pipeline"
    for name in kpred.__all__:
        assert getattr(kpred, name) is not None
    assert set(kpred.__all__) <= set(dir(kpred))
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = kpred.no_such_name
