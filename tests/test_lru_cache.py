"""Memory of the values that were used last."""

from kpred.lru_cache import LruCache


def test_what_was_not_used_longest_is_dropped_first() -> None:
    cache: LruCache[str, int] = LruCache(2)
    cache.put("a", 1)
    cache.put("b", 2)
    assert cache.get("a") == 1
    cache.put("c", 3)
    assert (cache.get("a"), cache.get("b"), cache.get("c")) == (1, None, 3)
    cache.put("a", 4)
    assert (len(cache), cache.get("a")) == (2, 4)
    cache.clear()
    assert len(cache) == 0


def test_without_a_capacity_nothing_is_dropped() -> None:
    cache: LruCache[int, int] = LruCache()
    for number in range(1000):
        cache.put(number, number)
    assert all(cache.get(number) == number for number in range(1000))
