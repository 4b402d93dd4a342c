"""`onboard see`: rows, images and scores of a recording."""

import csv
import re
import resource
import shutil
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
import typer
from typer.testing import CliRunner, Result

from onboard.errors import UserError
from onboard.observations import ImageBox, Lead, LeadIdentity, Plate
from onboard.settings import load_settings
from onboard.tools.calibrate.cli import calibrate
from onboard.tools.see.annotated_frame import COLUMNS, AnnotatedFrame, annotate_frames
from onboard.tools.see.cli import see
from onboard.tools.see.ground_truth import GroundTruth
from onboard.tools.see.score import Scores, edit_distance
from onboard.vision.frames import Frame
from onboard.vision.networks import load_perception
from onboard.vision.settings import Calibration, VisionSettings
from onboard.vision.vehicle_finder import overlap
from sim_rig.rendering.scene import Scene, SceneCar
from tests.vision.drive import CAMERA, RENDERER, frames

TAG: dict[str, Any] = {"tag_id": 1, "tag_side_m": 0.4}


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A second of approaching a vehicle with a tag, with ground truth, a calibration and
    settings."""
    folder = tmp_path_factory.mktemp("see")
    lines = ["file,x_px,y_px,w_px,h_px,text,gap_m"]
    (folder / "pictures").mkdir()
    for stamp_s, image in frames(lambda t: Scene(cars=(SceneCar(12 - 2 * t, 0.5, **TAG),)), 1.0):
        name = f"f{round(10 * stamp_s)}.png"
        cv2.imwrite(str(folder / "pictures" / name), image)
        quad = RENDERER.plate_quad(SceneCar(12 - 2 * stamp_s, 0.5, **TAG))
        (x, y), (w, h) = quad[0], quad[2] - quad[0]
        lines.append(f"{name},{x},{y},{w},{h},TAG1,{12 - 2 * stamp_s}")
    (folder / "truth.csv").write_text("\n".join(lines))
    (folder / "vision.yaml").write_text("plates: false\ntag_side_m: 0.4\n")
    calibration = CAMERA.model_dump(exclude={"source", "fps"})
    (folder / "camera.yaml").write_text(
        "\n".join(
            f"{name}: {list(v) if isinstance(v, tuple) else v}" for name, v in calibration.items()
        )
    )
    return folder


def invoked(*arguments: str | Path) -> Result:
    app = typer.Typer()
    app.command()(see)
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    if result.exception is not None:
        raise result.exception
    return result


def run(*arguments: str | Path) -> str:
    return invoked(*arguments).stdout


def stderr_of(*arguments: str | Path) -> str:
    return invoked(*arguments).stderr


def options(drive: Path) -> list[str | Path]:
    return ["--vision", drive / "vision.yaml", "--camera", drive / "camera.yaml"]


def test_there_is_a_row_for_each_plate_and_frame(drive: Path, tmp_path: Path) -> None:
    run(drive / "pictures", "--fps", "10", *options(drive), "--csv", tmp_path / "rows.csv")

    with (tmp_path / "rows.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert [row["frame"] for row in rows] == [str(index) for index in range(10)]
    last = rows[-1]
    assert (last["file"], last["stamp_s"], last["text"], last["is_lead"]) == (
        "f9.png",
        "0.900",
        "TAG1",
        "1",
    )
    assert float(last["gap_m"]) == pytest.approx(12 - 1.8, rel=0.03)
    assert float(last["closing_speed_m_s"]) == pytest.approx(2.0, abs=1.0)
    assert last["candidates"].split(":")[0] == "TAG1"
    assert (rows[0]["gap_m"], rows[0]["candidates"]) == ("", "")  # one detection is no lead


def test_a_printed_csv_is_all_of_the_standard_output(drive: Path, tmp_path: Path) -> None:
    given = (drive / "pictures", "--fps", "10", *options(drive), "--csv")
    run(*given, tmp_path / "rows.csv")

    result = invoked(*given, "-")

    assert result.stdout == (tmp_path / "rows.csv").read_text()
    assert "frames: 10" in result.stderr


def test_images_without_a_rate_are_independent(drive: Path, tmp_path: Path) -> None:
    run(drive / "pictures", *options(drive), "--csv", tmp_path / "rows.csv")

    with (tmp_path / "rows.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["frame"] for row in rows] == [str(index) for index in range(10)]
    assert {row["is_lead"] for row in rows} == {"0"}


def test_of_independent_images_each_plate_is_printed(drive: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty.png"
    cv2.imwrite(str(empty), np.tile(np.arange(640, dtype=np.uint8)[:, None] // 3, (360, 1, 3)))

    plate = run(drive / "pictures" / "f0.png", *options(drive)).splitlines()
    none = run(empty, *options(drive)).splitlines()
    printed = run(drive / "pictures" / "f0.png", *options(drive), "--csv", "-")

    assert re.match(r"f0\.png: TAG1 \([01]\.\d\d\), \d+ px wide at \d+, \d+$", plate[0])
    assert plate[1].startswith("frames: 1, plates: 1")
    assert none[0] == "empty.png: no plate found"
    assert "px wide" not in printed


def test_of_a_drive_each_text_is_printed_once(drive: Path) -> None:
    text, tally = run(drive / "pictures", "--fps", "10", *options(drive)).splitlines()

    assert re.match(r"TAG1 \([01]\.\d\d\): frames: 10, 0\.0 to 0\.9 s, \d+ to \d+ px wide$", text)
    assert tally.startswith("frames: 10")


def test_a_drive_is_searched_as_often_as_in_a_car_and_on_demand_in_every_frame(
    drive: Path, tmp_path: Path
) -> None:
    beside = SceneCar(9.0, 3.0, tag_id=2, tag_side_m=0.4)
    for stamp_s, image in frames(lambda t: Scene(cars=(SceneCar(12 - t, 0.0, **TAG), beside)), 2.0):
        cv2.imwrite(str(tmp_path / f"f{round(10 * stamp_s)}.png"), image)

    def rows_of(text: str, *given: str) -> int:
        printed = run(tmp_path, "--fps", "10", *options(drive), *given, "--csv", "-")
        return sum(row["text"] == text for row in csv.DictReader(printed.splitlines()))

    assert rows_of("TAG1") == rows_of("TAG1", "--every-frame") == 20
    assert 10 <= rows_of("TAG2") <= 15  # that of the next lane five times a second, once settled
    assert rows_of("TAG2", "--every-frame") == 20


def test_scores_are_printed_against_ground_truth(drive: Path) -> None:
    _, *output = run(
        drive / "pictures", "--fps", "10", *options(drive), "--truth", drive / "truth.csv"
    ).splitlines()

    assert output[0].startswith("frames: 10, plates: 10, plates read: 10, frames with a lead: 8")
    assert output[1].split()[:4] == ["frames", "plates", "found", "exact"]
    assert output[2].split()[:7] == ["all", "10", "10", "100.0", "%", "100.0", "%"]


@pytest.mark.long
def test_the_annotated_video_has_every_frame(drive: Path, tmp_path: Path) -> None:
    run(drive / "pictures", "--fps", "10", *options(drive), "--video", tmp_path / "seen.mp4")

    with av.open(str(tmp_path / "seen.mp4")) as container:
        pictures = [frame.to_ndarray(format="bgr24") for frame in container.decode(video=0)]
    assert len(pictures) == 10
    assert pictures[0].shape == (540, 960, 3)
    quad = RENDERER.plate_quad(SceneCar(12 - 1.8, 0.5, **TAG))
    x, y = quad[0].astype(int)
    frame_bgr = pictures[-1][y - 2 : y + 3, x + 4 : x + 14].reshape(-1, 3).astype(int)
    assert (frame_bgr[:, 1] - frame_bgr[:, 2]).max() > 60  # green around the lead's tag


@pytest.mark.parametrize(
    "arguments",
    [
        ["nowhere.mp4"],
        ["{}", "--camera", "nowhere.yaml"],
        ["{}", "--csv", "/nowhere/rows.csv"],
        ["{}", "--video", "/nowhere/seen.mp4"],
        ["{}", "--truth", "nowhere.csv"],
        ["{}", "--truth", "{}/../camera.yaml"],
    ],
)
def test_a_users_mistake_is_an_error(drive: Path, arguments: list[str]) -> None:
    with pytest.raises(UserError, match=r"nowhere|camera\.yaml"):
        run(*(argument.format(drive / "pictures") for argument in arguments))


def write_ground_truth(folder: Path, *rows: str) -> Path:
    path = folder / "rows-of-truth.csv"
    path.write_text("\n".join(rows), encoding="utf-8-sig")  # as spreadsheets write it
    return path


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("frame,gap_m", "{0},{1}"),
        ("frame,stamp_s,gap_m", "{0},0,{1}"),
        ("file,text,gap_m", "f{0}.png,TAG1,{1}"),
        ("file,frame,gap_m", "pictures/f{0}.png,{2},{1}"),  # counted from somewhere else
        ("file,x_px,y_px,w_px,h_px,text,gap_m", "f{0},,,,,TAG1,{1}"),
    ],
)
def test_a_lead_is_scored_by_the_given_columns(
    drive: Path, tmp_path: Path, head: str, row: str
) -> None:
    """Ground truth of a range finder has distances and no boxes."""
    rows = [row.format(index, 12 - 0.2 * index, index + 40) for index in range(10)]

    _, *output = run(
        drive / "pictures",
        "--fps",
        "10",
        *options(drive),
        "--truth",
        write_ground_truth(tmp_path, head, *rows),
    ).splitlines()

    assert output[1].split()[-4:] == ["right", "lead", "gap", "error"]
    assert output[2].split()[-4:-2] == ["80.0", "%"]
    assert float(output[2].split()[-2]) < 3.0
    if "text" in head:
        assert "100.0 %" in output[2]


@pytest.mark.parametrize(
    ("rows", "why"),
    [
        (["picture,plate", "f1.png,TAG1"], "has the columns picture, plate; allowed are"),
        (
            ["file,text", "g1.png,TAG1"],
            "has rows for g1.png, and for none of these frames, such as f9",
        ),
        (["frame,gap_m", "1,near"], ":2: could not convert"),
        (["file,x_px,text", "f1.png,3,TAG1"], ":2: a box needs four numbers"),
        (["frame,gap_m", "1,0"], ":2: gap_m is 0"),
        (["frame,gap_m", "1,nan"], ":2: gap_m is nan"),
        (["frame,gap_m,text", "1,inf,TAG1"], ":2: gap_m is inf"),
        (["file,x_px,y_px,w_px,h_px", "f1.png,1,2,nan,4"], ":2: invalid box 1, 2, nan, 4"),
        (["file,x_px,y_px,w_px,h_px", "f1.png,1,2,-3,4"], ":2: invalid box 1, 2, -3, 4"),
    ],
)
def test_invalid_ground_truth_is_an_error(
    drive: Path, tmp_path: Path, rows: list[str], why: str
) -> None:
    with pytest.raises(UserError) as raised:
        run(drive / "pictures", *options(drive), "--truth", write_ground_truth(tmp_path, *rows))

    assert why in str(raised.value)


def test_a_rate_of_zero_is_an_error(drive: Path) -> None:
    with pytest.raises(UserError, match="fps: Input should be greater than 0"):
        run(drive / "pictures", "--fps", "0")


def test_images_of_another_aspect_ratio_than_calibrated_are_an_error(
    drive: Path, tmp_path: Path
) -> None:
    camera = tmp_path / "camera.yaml"
    camera.write_text("width_px: 1242\nheight_px: 375\nprincipal_y_px: 180\n")

    message = (
        r"no frame could be processed .*frame_size \(960 x 540 px, calibrated for 1242 x 375\)"
    )
    with pytest.raises(UserError, match=message):
        run(drive / "pictures", "--camera", camera)


def test_the_first_invalid_image_is_named(drive: Path, tmp_path: Path) -> None:
    whole = (drive / "pictures" / "f0.png").read_bytes()
    for index, data in enumerate([whole, whole[:20], b""]):
        (tmp_path / f"{index}.png").write_bytes(data)

    assert "discarded: corrupt_frame: 2 (first 1.png, frame 1)" in run(tmp_path, *options(drive))


def test_a_frozen_camera_is_reported_with_its_first_lost_frame(drive: Path, tmp_path: Path) -> None:
    picture = (drive / "pictures" / "f0.png").read_bytes()
    for index in range(10):
        (tmp_path / f"{index}.png").write_bytes(picture)

    output = run(tmp_path, "--fps", "10", *options(drive))

    assert "frozen: 3 (first 7.png, frame 7)" in output


@pytest.mark.parametrize("output", ["--csv", "--video"])
def test_inputs_are_not_overwritten(drive: Path, tmp_path: Path, output: str) -> None:
    truth = write_ground_truth(tmp_path, "file,text", "f1.png,TAG1")
    before = truth.read_bytes()

    with pytest.raises(UserError, match=r"rows-of-truth\.csv: is an input"):
        run(drive / "pictures", "--truth", truth, output, truth)

    assert truth.read_bytes() == before


def test_a_calibration_is_not_written_over_the_recording(tmp_path: Path) -> None:
    video = tmp_path / "board.mp4"
    video.write_bytes(b"a recording")

    with pytest.raises(UserError, match=r"board\.mp4: is an input"):
        calibrate(str(video), board="9x6", out=video)

    assert video.read_bytes() == b"a recording"


@pytest.mark.parametrize("name", ["seen.gif", "seen.avi", "seen.pictures", "seen"])
def test_a_video_that_cannot_be_written_is_an_error(drive: Path, tmp_path: Path, name: str) -> None:
    with pytest.raises(UserError, match=f"{name}: cannot be written"):
        run(drive / "pictures", *options(drive), "--video", tmp_path / name)


def test_a_full_disk_is_an_error(drive: Path) -> None:
    with pytest.raises(UserError, match="/dev/full: cannot be written: No space left"):
        run(drive / "pictures", *options(drive), "--csv", "/dev/full")


@pytest.mark.long
@pytest.mark.parametrize("name", ["seen.webm", "seen.mp4"])
def test_a_video_on_a_full_disk_is_an_error(drive: Path, tmp_path: Path, name: str) -> None:
    """A limit of the size of files, which the kernel enforces as a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
    try:
        with pytest.raises(UserError, match=f"{name}: cannot be written: it is not whole"):
            run(drive / "pictures", *options(drive), "--video", tmp_path / name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_an_internal_error_is_not_reported_as_a_full_disk(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def mistake(*_: object) -> None:
        raise ValueError("ours")

    monkeypatch.setattr("onboard.vision.perception.Perception.receive_frame", mistake)
    outputs: list[str | Path] = ["--csv", tmp_path / "rows.csv", "--video", tmp_path / "seen.mp4"]

    with pytest.raises(ValueError, match="ours"):
        run(drive / "pictures", *options(drive), *outputs)


def test_images_of_different_sizes_go_into_one_video(drive: Path, tmp_path: Path) -> None:
    (tmp_path / "odd").mkdir()
    for index, (w, h) in enumerate([(1, 1), (641, 361), (101, 1000), (2, 2), (64, 64)]):
        cv2.imwrite(str(tmp_path / "odd" / f"{index}.png"), np.full((h, w, 3), 90, np.uint8))
    shutil.copy(drive / "pictures" / "f0.png", tmp_path / "odd" / "9.png")

    run(tmp_path / "odd", "--vision", drive / "vision.yaml", "--video", tmp_path / "seen.mp4")

    with av.open(str(tmp_path / "seen.mp4")) as container:
        sizes = [(frame.width, frame.height) for frame in container.decode(video=0)]
    assert sizes == [(640, 360)] * 5


def test_a_truncated_video_is_reported(drive: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole.avi"
    with av.open(str(whole), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height = 960, 540
        for name in sorted((drive / "pictures").glob("*.png")):
            image = np.asarray(cv2.imread(str(name)), np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode())
    torn = tmp_path / "torn.avi"
    torn.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])

    assert "truncated" not in stderr_of(whole, *options(drive))
    assert "torn.avi: states 10 frames, and" in stderr_of(torn, *options(drive))


def frame_with(name: str, *events: Plate | Lead) -> AnnotatedFrame:
    return AnnotatedFrame(0, Frame(0.0, np.zeros((8, 8, 3), np.uint8), name), events)


def plate(text: str | None, confidence: float = 1.0, x_px: float = 10.0) -> Plate:
    return Plate(0.0, ImageBox(x_px, 10.0, 100.0, 30.0), text, confidence, is_lead=False)


def test_scores_count_detections_and_readings(tmp_path: Path) -> None:
    (tmp_path / "truth.csv").write_text(
        "file,x_px,y_px,w_px,h_px,text\n"
        "us/1.jpg,10,10,100,30,GN417KB\n"
        "us/2.jpg,10,10,100,30,rd-288 hx\n"  # as people write them
        "eu/3.jpg,10,10,100,30,BL635TN\n"
        "eu/4.jpg,10,10,100,30,YW903MS\n"
    )
    scores = Scores(GroundTruth.read(tmp_path / "truth.csv"), certain_from=0.9)

    scores.add(frame_with("us/1.jpg", plate("GN417KB"), plate("CAFE", x_px=500.0)))
    scores.add(frame_with("us/2.jpg", plate("RD2B8HX", 0.5)))
    scores.add(frame_with("eu/3.jpg"))
    scores.add(
        frame_with("eu/4.jpg", plate("YW903MS", 0.95, x_px=50.0))
    )  # read, but the box is off
    scores.add(frame_with("unheard/of.jpg", plate("ABCDEF")))

    rows = {row.pop(""): row for row in scores.rows()}
    assert list(rows) == ["eu", "us", "all"]
    assert rows["all"] == {
        "frames": "4",
        "plates": "4",
        "found": "50.0 %",
        "exact": "50.0 %",
        "characters": f"{100 * 20 / 28:.1f} %",
        "false texts a frame": "0.250",
        "certain": "50.0 %",
        "wrong if certain": "33.3 %",
    }
    assert rows["us"]["exact"] == "50.0 %"


def test_a_lead_without_a_true_one_is_a_false_lead(tmp_path: Path) -> None:
    (tmp_path / "truth.csv").write_text("frame,gap_m\n0,inf\n1,inf\n2,12\n")
    scores = Scores(GroundTruth.read(tmp_path / "truth.csv"), certain_from=0.9)
    lead = Lead(0.0, LeadIdentity.UNKNOWN, gap_m=12.0)

    for index, event in enumerate([lead, Lead(0.0, LeadIdentity.NO_LEAD), lead]):
        scores.add(replace(frame_with("drive.mp4"), index=index, events=(event,)))

    (row,) = scores.rows()
    assert (row["frames"], row["plates"], row["false texts a frame"]) == ("3", "0", "0.000")
    assert (row["false lead"], row["right lead"]) == ("50.0 %", "100.0 %")


OURS, THEIRS = "GN417KB", "XY999ZZ"


@pytest.mark.parametrize(
    ("known", "text", "gap_m", "scored"),
    [
        # With a range finder's truth, a report at another distance is another vehicle.
        ("", THEIRS, 5.0, ("0.0 %", "50.0 %")),
        ("", THEIRS, 10.1, ("100.0 %", "1.0 %")),
        # A plate reported as the lead's decides its identity, whatever the gap's error.
        (OURS, "GN4I7KB", 5.0, ("100.0 %", "50.0 %")),
        (OURS, THEIRS, 5.0, ("0.0 %", None)),
        (OURS, None, 10.1, ("100.0 %", "1.0 %")),
    ],
)
def test_a_lead_is_right_by_its_plate_or_else_by_its_distance(
    tmp_path: Path, known: str, text: str | None, gap_m: float, scored: tuple[str, str | None]
) -> None:
    (tmp_path / "truth.csv").write_text(f"frame,text,gap_m\n0,{known},10\n")
    scores = Scores(GroundTruth.read(tmp_path / "truth.csv"), certain_from=0.9)
    lead = Lead(0.0, LeadIdentity.UNKNOWN, gap_m=gap_m)

    scores.add(frame_with("drive.mp4", replace(plate(text), is_lead=True), lead))

    (row,) = scores.rows()
    assert (row["right lead"], row.get("gap error")) == scored


def test_another_vehicles_plate_does_not_score_an_undetected_lead(tmp_path: Path) -> None:
    (tmp_path / "truth.csv").write_text(f"frame,text,gap_m\n0,{OURS},10\n")
    scores = Scores(GroundTruth.read(tmp_path / "truth.csv"), certain_from=0.9)
    lead = Lead(0.0, LeadIdentity.UNKNOWN, gap_m=10.1)

    scores.add(frame_with("drive.mp4", plate(THEIRS), lead))

    (row,) = scores.rows()
    assert row["right lead"] == "100.0 %"


def test_there_are_never_more_certain_plates_than_true_ones(tmp_path: Path) -> None:
    (tmp_path / "truth.csv").write_text(
        "file,x_px,y_px,w_px,h_px,text\n1.jpg,10,10,100,30,GN417KB\n"
    )
    scores = Scores(GroundTruth.read(tmp_path / "truth.csv"), certain_from=0.9)

    scores.add(frame_with("1.jpg", plate("GN417KB"), plate("RD288HX", x_px=300.0)))

    (row,) = scores.rows()
    assert (row["certain"], row["wrong if certain"]) == ("100.0 %", "50.0 %")


def test_a_name_of_two_files_of_the_ground_truth_is_an_error(tmp_path: Path) -> None:
    rows = ("file,text", "us/1.jpg,GN417KB", "eu/1.jpg,RD288HX")
    truth = GroundTruth.read(write_ground_truth(tmp_path, *rows))

    assert [plate.text for plate in truth.of(frame_with("us/1.jpg")) or []] == ["GN417KB"]
    with pytest.raises(UserError, match=r"1\.jpg: the ground truth has us/1\.jpg and eu/1\.jpg"):
        truth.of(frame_with("1.jpg"))


@pytest.mark.parametrize(
    ("one", "other", "distance"),
    [("", "", 0), ("ABC", "", 3), ("KITTEN", "SITTING", 3), ("GN417KB", "GN417K8", 1)],
)
def test_edit_distance(one: str, other: str, distance: int) -> None:
    assert edit_distance(one, other) == edit_distance(other, one) == distance


def test_overlap_is_intersection_over_union() -> None:
    assert overlap(ImageBox(0, 0, 2, 2), ImageBox(1, 1, 2, 2)) == pytest.approx(1 / 7)
    assert overlap(ImageBox(0, 0, 2, 2), ImageBox(2, 0, 2, 2)) == 0.0


def test_the_calibration_in_the_docs_is_one(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "vision.md").read_text()
    example = page.split("write them down:\n\n")[1].split("\n\nPixels count")[0]
    camera = tmp_path / "camera.yaml"
    camera.write_text(textwrap.dedent(example))

    assert load_settings(camera, Calibration).width_px == 1242
    four = camera.read_text().replace(", 0.0]", "]")
    camera.write_text(four)
    assert load_settings(camera, Calibration).distortion == (-0.37, 0.19, 0.0, 0.0, 0.0)


def test_a_lead_without_a_plate_and_a_frame_without_any_have_a_row_each() -> None:
    box = ImageBox(40.0, 50.0, 60.0, 20.0)
    unread = Lead(0.0, LeadIdentity.UNKNOWN, gap_m=12.0, closing_speed_m_s=-1.0, box=box)
    no_lead = Lead(0.1, LeadIdentity.NO_LEAD)

    rows = [
        dict(zip(COLUMNS, row, strict=True))
        for event in (unread, no_lead)
        for row in frame_with("drive.mp4", event).rows()
    ]

    assert [row["lead"] for row in rows] == ["unknown", "no_lead"]
    assert [row["x_px"] for row in rows] == ["40.0", ""]
    assert [row["gap_m"] for row in rows] == ["12.00", ""]


@pytest.mark.parametrize(
    ("lead", "words"),
    [
        (Lead(0.0, LeadIdentity.NO_LEAD), "the lane is free"),
        (Lead(0.0, LeadIdentity.UNKNOWN), "no lead found"),
        (
            Lead(0.0, LeadIdentity.UNKNOWN, gap_m=12.0, closing_speed_m_s=1.0),
            "plate unknown  12.0 m  closing +1.0 m/s",
        ),
    ],
)
def test_the_caption_tells_a_lane_without_a_lead_from_a_lead_without_a_text(
    lead: Lead, words: str
) -> None:
    assert frame_with("drive.mp4", lead).caption == f"0.0 s  {words}"


def test_a_vehicle_beside_is_drawn_where_it_is_between_two_looks_at_it() -> None:
    def beside(stamp_s: float) -> SceneCar:
        return SceneCar(8.0 + 3.0 * stamp_s, 3.0, tag_id=2, tag_side_m=0.4)

    drive = frames(lambda t: Scene(cars=(SceneCar(12.0, 0.0, **TAG), beside(t))), 2.0)
    given = (Frame(stamp_s, np.asarray(image)) for stamp_s, image in drive)
    perception = load_perception(CAMERA, VisionSettings(plates=False, tag_side_m=0.4))

    looks = 0
    for seen in annotate_frames(given, perception):
        if seen.frame.stamp_s > 1.0:
            quad = RENDERER.plate_quad(beside(seen.frame.stamp_s))
            true = ImageBox(*quad[0], *(quad[2] - quad[0]))
            assert max(overlap(box, true) for box in seen.vehicles or ()) > 0.6
            looks += any(overlap(plate.box, true) > 0.6 for plate in seen.plates)
    assert 3 <= looks < 9


def test_vehicles_are_drawn_and_what_only_looks_like_a_plate_is_not() -> None:
    rear, rail = ImageBox(10.0, 10.0, 30.0, 20.0), ImageBox(60.0, 10.0, 30.0, 20.0)
    frame = Frame(0.0, np.zeros((60, 120, 3), np.uint8), "drive.mp4")
    events = (replace(plate("I1TI1", 0.3), box=rail), Lead(0.0, LeadIdentity.UNKNOWN))

    def is_drawn(vehicles: tuple[ImageBox, ...] | None) -> list[bool]:
        drawn = AnnotatedFrame(0, frame, events, vehicles).annotated()
        return [
            bool(drawn[10, round(box.x_px) : round(box.x_px) + 30].any()) for box in (rear, rail)
        ]

    assert is_drawn((rear,)) == [True, False]
    assert is_drawn((rear, rail)) == [True, True]
    assert is_drawn(None) == [False, True]


@pytest.mark.parametrize("width_px", [320, 3840])
def test_the_caption_is_as_large_as_the_image_asks_and_not_cut(width_px: int) -> None:
    height_px = width_px * 9 // 16
    frame = Frame(0.0, np.zeros((height_px, width_px, 3), np.uint8), "drive.mp4")
    lead = Lead(0.0, LeadIdentity.UNKNOWN, gap_m=12.0, closing_speed_m_s=1.0)

    written = AnnotatedFrame(0, frame, (lead,)).annotated().any(axis=-1)

    columns, rows = np.flatnonzero(written.any(axis=0)), np.flatnonzero(written.any(axis=-1))
    assert columns[-1] < width_px - 8
    assert np.ptp(rows) > height_px / 40
