"""Comparison of results of gn.render."""


def same(a, b):
    assert a.passes.keys() == b.passes.keys()
    for name in a.passes:
        assert a.passes[name].tobytes() == b.passes[name].tobytes(), name
