import pytest

import kinertia


@pytest.mark.slow
def test_a_notebook_without_plotly_says_what_to_install(short_fit, without):
    without("plotly")
    with pytest.raises(kinertia.KinertiaError, match=r"plotly.*pip install 'kinertia\[plots\]'"):
        short_fit.plot.bsp()
