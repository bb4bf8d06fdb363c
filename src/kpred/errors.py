"""Errors that a user can mend: one sentence that names the file (or argument) and the mend."""


class KpredError(Exception):
    """Base of all errors that the command line shows as one sentence, without a traceback."""


class ScanError(KpredError):
    """A scan is missing, unreadable, too small or degenerate."""


class MeshError(KpredError):
    """A CAD mesh is missing, unreadable or without a single face of non-zero area."""


class PackError(KpredError):
    """A mesh pack (.npz) is missing, truncated or not laid out as a pack."""


class DatabaseError(KpredError):
    """A database is missing, foreign, locked, truncated, or was made by other weights."""


class ModelError(KpredError):
    """Weights or their config are missing, truncated or do not fit each other."""


class CheckpointError(KpredError):
    """A training checkpoint is missing, truncated or belongs to another run."""


class ConfigError(KpredError):
    """An option or a configuration has a value that cannot work."""


class OutputError(KpredError):
    """A result cannot be written: unknown extension, missing permission or a full disk."""


class RecordError(KpredError):
    """A record of a fit is missing, damaged, or what it was made from has changed."""


class ManifestError(KpredError):
    """A manifest or a batch of scans is missing, unreadable, or not what was begun."""
