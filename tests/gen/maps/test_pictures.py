"""Pictures of one surface: nothing cut, the law and its range drawn, no surface that fails."""

import numpy as np
import pytest

from gen import cli
from gen.spectral import SelfAffineSpectrum, generate_spectral

pytest.importorskip("matplotlib", reason="needs the extra plot")

from matplotlib.backends.backend_agg import FigureCanvasAgg

from gen.maps import pictures

ROUGH = generate_spectral(
    (129, 129), 1000.0, SelfAffineSpectrum(0.7, 250, 16.5), np.random.default_rng(1), rms_height=2.0
)
SHAPES = {
    "square": (ROUGH, "1000"),
    "oblong": (ROUGH[:, :50], "1000,400"),
    "tall": (ROUGH[:50], "400,1000"),
    "sliver": (ROUGH[:, :5], "1000,30"),
    "flat": (np.zeros((20, 20)), "100"),
    "two nodes": (np.array([[0.0, 1.0], [2.0, 5.0]]), "10"),
    "two heights": (np.repeat([0.0, 1.0], 200).reshape(20, 20), "10"),
    "huge": (1e300 * ROUGH, "1000"),
    "tiny": (1e-300 * ROUGH, "1000"),
    "lost": (1e9 + 1e-6 * ROUGH, "1000"),
}


@pytest.mark.few(3)
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shape", SHAPES)
def test_every_surface_is_drawn_and_nothing_is_cut(shape, tmp_path, monkeypatch, capsys):
    heights, side = SHAPES[shape]
    monkeypatch.chdir(tmp_path)
    np.save("surface.npy", heights)
    figures, save = [], pictures.save
    monkeypatch.setattr(
        pictures, "save", lambda figure, path: figures.append(figure) or save(figure, path)
    )
    assert cli.main(["describe", "surface.npy", "--side", side, "--plot", "one.png"]) == 0
    assert (tmp_path / "one.png").read_bytes().startswith(b"\x89PNG")
    assert "self-affine law" in capsys.readouterr().out
    (figure,) = figures
    renderer = FigureCanvasAgg(figure).get_renderer()
    box, (width, height) = figure.get_tightbbox(renderer), figure.get_size_inches()
    assert min(box.x0, box.y0) >= 0, "something is cut on the left or below"
    assert (box.x1 <= width, box.y1 <= height) == (True, True), "something is cut"


def test_the_law_is_printed_for_the_generator(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    np.save("surface.npy", ROUGH)
    ask = ["describe", "surface.npy", "--side", "1000", "--boundary", "periodic"]
    assert cli.main([*ask, "--plot", "one.svg"]) == 0
    lines = capsys.readouterr().out.splitlines()
    printed = {line.split()[0]: float(line.split()[1]) for line in lines[-4:]}
    assert list(printed) == ["hurst", "roll_off", "cut_off", "rms_height"]
    assert printed["hurst"] == pytest.approx(0.7, abs=0.05)
    assert printed["roll_off"] == pytest.approx(250, rel=0.2)
    law = SelfAffineSpectrum(printed["hurst"], printed["roll_off"], printed["cut_off"])
    again = np.random.default_rng(2)
    generate_spectral((129, 129), 1000.0, law, again, rms_height=printed["rms_height"])
    drawn = (tmp_path / "one.svg").read_text()
    assert drawn.count("<svg") == 1


@pytest.mark.parametrize(
    ("picture", "message"),
    [("one.jpg", "ending in .png"), ("no/where.png", "no folder"), ("surface.npy", "is an input")],
)
def test_a_picture_that_cannot_be_is_one_line(picture, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    np.save("surface.npy", ROUGH)
    assert cli.main(["describe", "surface.npy", "--side", "9", "--plot", picture]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert (captured.err.count("\n"), captured.out) == (1, "")
