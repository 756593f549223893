"""The keys of `Reading` in messages: as options of commands, and as keys of scenes."""

from pathlib import Path

from gen.maps.settings import as_option, in_scene_words


def test_an_option_is_a_key_with_dashes():
    assert as_option("override_scale") == "--override-scale"
    assert as_option("despike 7") == "--despike 7"


def test_scenes_name_keys_without_dashes():
    message = "scan.npy: names no unit; give --unit, or --override-scale and (--side 9,9)"
    assert in_scene_words(message, Path("scan.npy")) == (
        "scan.npy: names no unit; give unit, or override_scale and (side 9,9)"
    )


def test_only_whole_options_of_maps_are_renamed():
    message = "a--side --units --boundary mirror --fill-mostly"
    assert in_scene_words(message, Path("scan.npy")) == message


def test_the_name_of_a_file_is_no_option():
    message = "my --side/scan.npy: holds no lengths; give --side"
    assert in_scene_words(message, Path("my --side/scan.npy")) == (
        "my --side/scan.npy: holds no lengths; give side"
    )
