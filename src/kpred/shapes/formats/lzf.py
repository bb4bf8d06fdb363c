"""Decompression of the LZF format, which PCD files of kind ``binary_compressed`` use."""

from __future__ import annotations


def decompress_lzf(data: bytes, size: int) -> bytes:
    """Decompress ``data`` into exactly ``size`` bytes.

    A control byte below 32 is followed by that many plus one literal bytes; any other one copies bytes from earlier
    output: length in its top 3 bits (7: one more byte is added), distance in the low 5 bits and one further byte.
    Source: LibLZF by Marc Lehmann.

    Raises:
        ValueError: the data is damaged or does not give ``size`` bytes.
    """
    out = bytearray()
    at, end = 0, len(data)
    try:
        while at < end:
            if len(out) > size:
                raise ValueError(f"more than {size} bytes come out")
            control = data[at]
            at += 1
            if control < 32:
                out += data[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += data[at]
                at += 1
            length += 2
            distance = ((control & 31) << 8) + data[at] + 1
            at += 1
            start = len(out) - distance
            if start < 0:
                raise ValueError("a reference before the start of the data")
            if distance >= length:
                out += out[start : start + length]
            else:  # The copy overlaps its own output, so the last bytes repeat.
                out += (out[start:] * (length // distance + 1))[:length]
    except IndexError:
        raise ValueError("the data ends within a reference") from None
    if len(out) != size:
        raise ValueError(f"{len(out)} bytes came out instead of {size}")
    return bytes(out)
