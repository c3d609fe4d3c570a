"""localize.frames: pictures and videos from outside are the sensor's frames, or are refused with the key to write."""

import struct

import cv2
import numpy as np
import pytest
from film import write_film
from PIL import Image

from conespot.localize.frames.reader import read_frames
from conespot.scene import InputError, Scene
from conespot.scene.sensor import Recorded

RANDOM = np.random.default_rng(1)
VALUES = RANDOM.integers(0, 4096, (30, 40), dtype=np.uint16)  # of 12 bits
GREY = (VALUES >> 4).astype(np.uint8)
COLOUR = np.stack([GREY, 255 - GREY, GREY[::-1]], axis=-1)
LINEAR = {"sensor": {"kind": "linear"}}
LIMITED = {"sensor": {"kind": "recorded", "camera": "srgb8", "range": "limited"}}


def scene(**keys):
    return Scene.model_validate({"camera": {"resolution": [40, 30]}, **keys})


def read(path, **keys):
    return next(read_frames([path], scene(**keys))).image


def test_a_12_bit_png_keeps_its_bits(tmp_path):
    cv2.imwrite(str(tmp_path / "x.png"), VALUES)
    image = read(tmp_path / "x.png", **LINEAR)
    assert image.dtype == np.uint16
    assert np.array_equal(image, VALUES)


@pytest.mark.parametrize("ending", ["png", "tiff"])
@pytest.mark.parametrize("below", [0, 1], ids=["shifted", "scaled"])
def test_12_bits_in_the_upper_ones_of_16_are_read_where_the_scene_says_so_else_refused(tmp_path, ending, below):
    path = tmp_path / f"x.{ending}"
    cv2.imwrite(str(path), (VALUES << 4) | below * (VALUES >> 8))
    assert np.array_equal(read(path, storage={"alignment": "left"}, **LINEAR), VALUES)
    with pytest.raises(InputError, match="write scene.storage.alignment: left"):
        read(path, **LINEAR)


def test_a_dark_frame_in_the_upper_bits_is_known_by_what_its_lower_ones_lack(tmp_path):
    cv2.imwrite(str(tmp_path / "x.png"), (VALUES >> 4) << 4)
    with pytest.raises(InputError, match="every value is a multiple of 16.* write scene.storage.alignment: left"):
        read(tmp_path / "x.png", **LINEAR)


def test_values_of_more_bits_than_told_are_no_left_aligned_ones(tmp_path):
    cv2.imwrite(str(tmp_path / "x.png"), np.minimum(VALUES * 4 + 1, 13832))
    with pytest.raises(
        InputError, match=r"holds values up to 13832, .* ends at 4095 \(12 bits\); write scene.sensor.bits: 14"
    ):
        read(tmp_path / "x.png", **LINEAR)


def test_lower_bits_with_values_of_their_own_are_not_thrown_away(tmp_path):
    cv2.imwrite(str(tmp_path / "x.png"), VALUES)
    with pytest.raises(InputError, match="write scene.storage.alignment: right"):
        read(tmp_path / "x.png", storage={"alignment": "left"}, **LINEAR)


def test_eight_bits_of_a_camera_of_twelve_are_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "x.png"), GREY)
    assert np.array_equal(read(tmp_path / "x.png"), GREY)
    with pytest.raises(InputError, match=r"x.png: has 8 bits a pixel, .*sensor has 12; .* scene.sensor.bits: 8"):
        read(tmp_path / "x.png", **LINEAR)


#: the picture upright, of the one stored, by the EXIF orientation: where row 0 and column 0 are (CP-3451, 4.6.4)
UPRIGHT = {
    1: lambda a: a,
    2: lambda a: a[:, ::-1],
    3: lambda a: a[::-1, ::-1],
    4: lambda a: a[::-1],
    5: lambda a: a.T,
    6: lambda a: a.T[:, ::-1],
    7: lambda a: a[::-1, ::-1].T,
    8: lambda a: a.T[::-1],
}


@pytest.mark.parametrize("ending", ["png", "jpg", "tiff"])
@pytest.mark.parametrize("orientation", UPRIGHT)
def test_the_files_own_orientation_is_obeyed(tmp_path, ending, orientation):
    path = tmp_path / f"x.{ending}"
    exif = Image.Exif()
    exif[274] = orientation
    stored = GREY if orientation < 5 else np.ascontiguousarray(GREY.T)
    Image.fromarray(stored).save(path, exif=exif, **({"quality": 100} if ending == "jpg" else {}))
    if ending == "jpg":
        stored = np.asarray(Image.open(path))
    assert np.array_equal(read(path), UPRIGHT[orientation](stored))


def test_the_scene_turns_and_then_mirrors(tmp_path):
    cv2.imwrite(str(tmp_path / "x.png"), GREY.T)
    with pytest.raises(InputError, match="write scene.storage.turned: 90, or 270"):
        read(tmp_path / "x.png")
    turned = read(tmp_path / "x.png", storage={"turned": 90, "mirrored": True})
    assert np.array_equal(turned, np.rot90(GREY.T, -1)[:, ::-1])


def test_colours_are_a_colour_cameras_or_one_of_them_is_named(tmp_path):
    path = tmp_path / "x.png"
    cv2.imwrite(str(path), COLOUR[..., ::-1])
    assert np.array_equal(read(path, sensor="srgb8-colour"), COLOUR)
    assert np.array_equal(read(path, storage={"channel": "green"}), COLOUR[..., 1])
    with pytest.raises(InputError, match=r"is in colour, but scene.sensor is grey; .*scene.storage.channel: green"):
        read(path)
    cv2.imwrite(str(path), np.stack([GREY] * 3, axis=-1))
    assert np.array_equal(read(path), GREY)
    cv2.imwrite(str(path), GREY)
    with pytest.raises(InputError, match="is grey, but scene.sensor has three colours"):
        read(path, sensor="srgb8-colour")


@pytest.mark.parametrize("ending", ["png", "tiff"])
def test_an_opaque_alpha_is_dropped_and_a_transparent_one_refused(tmp_path, ending):
    path = tmp_path / f"x.{ending}"
    opaque = np.dstack([COLOUR[..., ::-1], np.full(GREY.shape, 255, np.uint8)])
    cv2.imwrite(str(path), opaque)
    assert np.array_equal(read(path, sensor="srgb8-colour"), COLOUR)
    opaque[3, 4, 3] = 254
    cv2.imwrite(str(path), opaque)
    with pytest.raises(InputError, match="has transparent pixels"):
        read(path, sensor="srgb8-colour")


@pytest.mark.parametrize(("mode", "said"), [("P", "of a palette"), ("1", "of 1 bits")])
def test_a_png_of_a_palette_or_of_fewer_than_8_bits_is_refused(tmp_path, mode, said):
    Image.fromarray(np.tile(np.arange(400, dtype=np.uint8) // 2, (400, 1))).convert(mode).save(tmp_path / "x.png")
    with pytest.raises(InputError, match=f"is a PNG {said}; save it in grey or RGB"):
        read(tmp_path / "x.png")


def test_float_pixels_above_white_need_the_scenes_word(tmp_path):
    light = np.asarray(VALUES, np.float32)
    cv2.imwrite(str(tmp_path / "x.tiff"), light)
    with pytest.raises(InputError, match="write scene.storage.white: VALUE"):
        read(tmp_path / "x.tiff", **LINEAR)
    image = read(tmp_path / "x.tiff", storage={"white": 4095}, **LINEAR)
    np.testing.assert_allclose(image, light / 4095, rtol=1e-6)


def test_a_files_own_word_on_its_transfer_is_held_against_the_scene(tmp_path):
    from PIL.PngImagePlugin import PngInfo

    said = PngInfo()
    said.add(b"sRGB", b"\0")
    Image.fromarray(GREY).save(tmp_path / "x.png", pnginfo=said)
    assert np.array_equal(read(tmp_path / "x.png"), GREY)
    linear = {"kind": "linear", "bits": 8}
    with pytest.raises(InputError, match=r"says its values are sRGB, .*scene.storage.profile: ignored"):
        read(tmp_path / "x.png", sensor=linear)
    assert np.array_equal(read(tmp_path / "x.png", sensor=linear, storage={"profile": "ignored"}), GREY)


def test_a_lossless_film_gives_frames_to_the_bit_with_their_times(tmp_path):
    frames = [GREY, GREY[::-1].copy(), GREY[:, ::-1].copy()]
    found = list(read_frames([write_film(tmp_path / "x.mkv", frames)], scene()))
    assert all(np.array_equal(got.image, frame) for got, frame in zip(found, frames, strict=True))
    np.testing.assert_allclose([got.time_s for got in found], [0.0, 1 / 30, 2 / 30], atol=1e-3)
    assert found[2].name == f"{tmp_path / 'x.mkv'}, frame 2"
    film = write_film(tmp_path / "twelve.mkv", [VALUES], pixels="gray12le")
    assert np.array_equal(read(film, **LINEAR), VALUES)


def test_a_film_shows_its_codes_in_the_range_that_it_or_the_scene_states(tmp_path):
    silent = write_film(tmp_path / "x.mp4", [GREY] * 3, "libx264", "yuv420p")
    with pytest.raises(InputError, match="does not say whether its range is full or limited; write scene.sensor: "):
        read(silent)
    codes = read(silent, **LIMITED)
    assert np.abs(codes - (16 + GREY * (219 / 255))).mean() < 10
    full = write_film(tmp_path / "x.avi", [GREY], "mjpeg", "yuvj420p")
    with pytest.raises(InputError, match="says it is of full range; write scene.sensor.range: full"):
        read(full, **LIMITED)
    assert np.abs(read(full).astype(int) - GREY).mean() < 10


def test_the_colours_of_a_film_of_limited_range_are_the_recorders_codes(tmp_path):
    """A flat field of three values, which no compression touches, against the recorder's own code of them."""
    flat = np.full((30, 40, 3), [200, 100, 50], np.uint8)
    film = write_film(tmp_path / "x.mkv", [flat], "ffv1", "yuv444p", color_range=1, colorspace=5)
    camera = {"kind": "srgb8", "colour": True}
    codes = read(film, sensor={"kind": "recorded", "camera": camera, "range": "limited"})
    recorder = Recorded.model_validate({"camera": camera, "range": "limited"})
    np.testing.assert_allclose(codes[5, 5], recorder.code(np.array([200, 100, 50]) / 255), atol=1.5)
    with pytest.raises(InputError, match="write scene.sensor: {kind: recorded, camera: srgb8, range: limited}"):
        read(film, sensor="srgb8-colour")
    with pytest.raises(InputError, match="camera: {kind: emva, and what else stands there now}, range: limited}"):
        read(film, sensor={"kind": "emva", "chip": "cmv12000-rgb", "bits": 8, "gain": 0.02})


def test_a_folder_is_read_in_the_order_of_its_numbers_and_the_rest_of_it_left(tmp_path):
    for number in (10, 9, 100):
        cv2.imwrite(str(tmp_path / f"frame_{number}.png"), GREY)
    (tmp_path / "notes.txt").write_text("frames of Tuesday")
    names = [frame.name.rpartition("_")[2] for frame in read_frames([tmp_path], scene())]
    assert names == ["9.png", "10.png", "100.png"]


def write_stack(path, pages):
    assert cv2.imwritemulti(str(path), pages)
    return path


def test_the_pages_of_a_12_bit_tiff_are_frames_to_the_bit(tmp_path):
    path = write_stack(tmp_path / "x.tif", [VALUES, VALUES[::-1], VALUES // 2 + 1])
    found = list(read_frames([path], scene(**LINEAR)))
    assert [frame.name for frame in found] == [f"{path}, frame {number}" for number in range(3)]
    for frame, page in zip(found, [VALUES, VALUES[::-1], VALUES // 2 + 1], strict=True):
        assert frame.image.dtype == np.uint16
        assert np.array_equal(frame.image, page)


def test_a_page_of_another_size_is_named_before_any_is_read(tmp_path):
    path = write_stack(tmp_path / "x.tif", [VALUES, VALUES[:15, :20]])
    with pytest.raises(InputError, match=r"x.tif, frame 1: 20 x 15 px do not fit"):
        read(path, **LINEAR)


def directories(data):
    """Where the directories of a little-endian TIFF begin, and where each says what the next one is."""
    (at,) = struct.unpack_from("<I", data, 4)
    while at:
        says = at + 2 + 12 * struct.unpack_from("<H", data, at)[0]
        yield at, says
        (at,) = struct.unpack_from("<I", data, says)


def test_pages_that_lead_in_a_circle_or_out_of_the_file_are_refused(tmp_path):
    path = write_stack(tmp_path / "x.tif", [VALUES, VALUES])
    data = path.read_bytes()
    assert data[:2] == b"II"
    (first, _), (second, says) = directories(data)
    for leads, said in {
        first: "leads back",
        second: "leads back",
        len(data): "end early",
        0xFFFFFFFF: "end early",
    }.items():
        path.write_bytes(data[:says] + struct.pack("<I", leads) + data[says + 4 :])
        with pytest.raises(InputError, match=f"x.tif: cannot be read as TIFF: .*{said}"):
            read(path, **LINEAR)


def test_a_tiff_without_end_and_one_that_holds_more_than_its_pages_are_refused(tmp_path):
    path = write_stack(tmp_path / "x.tif", [VALUES])
    data = path.read_bytes()
    ((_, says),) = directories(data)
    path.write_bytes(data + bytes(9_000_000))
    with pytest.raises(InputError, match="x.tif: larger than a frame of 40 x 30 px can be"):
        read(path, **LINEAR)
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in ((256, 40), (257, 30), (258, 16)))
    size = 2 + len(entries) + 4
    pages = [struct.pack("<H", 3) + entries + struct.pack("<I", len(data) + (k + 1) * size) for k in range(10_001)]
    path.write_bytes(data[:says] + struct.pack("<I", len(data)) + data[says + 4 :] + b"".join(pages))
    with pytest.raises(InputError, match="more than 10000 pages"):
        read(path, **LINEAR)


def test_what_begins_like_no_image_and_what_is_no_file_are_one_sentence(tmp_path):
    (tmp_path / "x.png").write_text("hello")
    (tmp_path / "x.mkv").write_text("hello")
    (tmp_path / "nothing.png").touch()
    (tmp_path / "nothing.mkv").touch()
    (tmp_path / "empty").mkdir()
    for name, said in {
        "x.png": "begins like none of the images",
        "x.mkv": "cannot be read as a video",
        "none.png": "cannot be read: No such file",
        "nothing.png": "is empty; copy",
        "nothing.mkv": "is empty; copy",
        "empty": "holds no frame",
    }.items():
        with pytest.raises(InputError, match=said):
            read(tmp_path / name)


def test_a_videos_display_matrix_is_obeyed(tmp_path):
    """As a telephone that was held upright writes it: turn the picture clockwise (ISO 14496-12, 8.3.2)."""
    film = write_film(tmp_path / "x.mp4", [np.repeat(np.linspace(40, 200, 40, dtype=np.uint8)[:, None], 30, 1)] * 2,
                      "libx264", "yuv420p")  # fmt: skip
    plain = struct.pack(">9i", 1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30)
    turned = struct.pack(">9i", 0, 1 << 16, 0, -(1 << 16), 0, 0, 40 << 16, 0, 1 << 30)
    data, track = film.read_bytes(), film.read_bytes().index(b"tkhd")
    assert plain in data[track:]
    film.write_bytes(data[:track] + data[track:].replace(plain, turned, 1))
    upright = read(film, **LIMITED)
    assert upright.shape == (30, 40)
    assert np.all(np.diff(upright.astype(int).mean(axis=0)) < 0)  # what was at the top is to the right
