"""The application's page, and the client of the application `text`: checksums, answers, what is said again, and a motor on the virtual board's serial line."""

import re

import pytest

from tools.common.errors import UserError
from tools.common.paths import ROOT
from tools.live import board, text


class Answers:
    """A stream with prepared answers, one for each line that is said."""

    def __init__(self, *answers):
        self.answers, self.said, self.waiting = list(answers), [], b""

    def write(self, data):
        self.said.append(data.decode())
        self.waiting += self.answers.pop(0).encode() if self.answers else b""

    def read(self, size):
        data, self.waiting = self.waiting[:size], self.waiting[size:]
        return data


def answer(line):
    return text.checked(line) + "\r\n"


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(text, "ANSWER_S", 0.02)


@pytest.mark.parametrize("line, checked", [("run", "run*69"), ("stop", "stop*18"), ("speed 1500", "speed 1500*43"), ("status", "status*14")])
def test_checksum_is_that_of_nmea_0183(line, checked):
    assert text.checked(line) == checked and text.content(checked) == line


@pytest.mark.parametrize("line", ["", "run", "run*", "run*68", "run*6", "*00", "row 3 -12 5", "r\xfcn*69"])
def test_a_line_without_a_right_checksum_says_nothing(line):
    assert text.content(line) is None


def test_an_answer_tells_what_the_drive_does():
    stream = Answers(answer("ok run 1 speed -1498 fault NONE"))
    assert text.TextDrive(stream).command("status") == text.Status(True, -1498, "NONE") and stream.said == ["status*14\n"]


def test_what_was_disturbed_is_said_again():
    stream = Answers("", "ok run 0 sp%ed 0 fault NONE*6A\r\n", answer("ok run 0 speed 0 fault NONE"))
    assert text.TextDrive(stream).command("stop") == text.Status(False, 0, "NONE") and stream.said == ["stop*18\n"] * 3


def test_lines_of_the_fault_recorder_in_between_are_passed_over():
    stream = Answers("row 3 1 2 3\r\n" + answer("ok run 0 speed 0 fault STALL"))
    assert text.TextDrive(stream).command("status").fault == "STALL"


@pytest.mark.parametrize("word, remedy", [("range", "MINIMUM_SPEED_RPM"), ("refused", "clear the fault")])
def test_a_refusal_names_the_remedy(word, remedy):
    with pytest.raises(UserError, match=remedy):
        text.TextDrive(Answers(answer(f"{word} run 0 speed 0 fault STALL"))).command("run")


def test_silence_names_what_to_look_at():
    with pytest.raises(UserError, match="APP=text"):
        text.TextDrive(Answers()).command("status")


def test_the_client_turns_a_motor_of_the_virtual_board(monkeypatch):
    monkeypatch.setattr(text, "ANSWER_S", 2.0)
    made_of = board.parts(app="text")
    live = board.LiveBoard(made_of)
    drive = text.TextDrive(board.BoardStream(live))
    drive.command("speed 1500")
    drive.command("run")
    for _ in range(5):
        live.run(0.5)
        status = drive.command("status")
    assert status.running and status.speed_rpm == pytest.approx(1500, abs=20) and status.fault == "NONE"
    live.run(3.5) # nobody speaks: it stops
    assert drive.command("status") == text.Status(False, 0, "NONE")
    live.close()


@pytest.mark.parametrize("arguments, said, shown", [
    (["run", "1500", "--seconds", "0"], ["speed 1500", "run", "stop"], "stands"), (["speed", "-900"], ["speed -900", "status"], "runs, 1498 rpm, fault NONE"),
    (["fault"], ["fault"], "NONE"), (["status"], ["status"], "runs, 1498 rpm"), (["clear"], ["clear"], "runs"), (["stop"], ["stop"], "stands")])
def test_each_command_of_the_client_says_its_lines(monkeypatch, capsys, arguments, said, shown):
    spoken = []

    def answer(self, line):
        spoken.append(line)
        return text.Status(line != "stop", 0 if line == "stop" else 1498, "NONE")
    monkeypatch.setattr(text.TextDrive, "command", answer)
    monkeypatch.setattr(text.lnet, "open_port", lambda port: None)
    assert text.main(["/dev/null", *arguments]) == 0
    out = capsys.readouterr().out
    assert spoken == said and (out == "NONE\n" if arguments == ["fault"] else shown in out)


def test_a_drive_that_was_told_to_stop_and_still_turns_is_said_to_stop(monkeypatch, capsys):
    monkeypatch.setattr(text.lnet, "open_port", lambda port: Answers(answer("ok run 1 speed 1498 fault NONE")))
    assert text.main(["/dev/ttyUSB0", "stop"]) == 0
    assert capsys.readouterr().out == "stops, 1498 rpm, fault NONE\n"


def test_a_port_that_goes_away_is_told_in_one_line(monkeypatch, capsys):
    class Gone(Answers):
        def write(self, data):
            raise OSError(5, "Input/output error")
    monkeypatch.setattr(text.lnet, "open_port", lambda port: Gone())
    assert text.main(["/dev/ttyUSB0", "status"]) == 2
    assert "the port is gone" in capsys.readouterr().err


@pytest.mark.parametrize("words, told", [
    (["speed"], "speed needs a number: speed 1500"), (["stop", "1500"], "stop takes no number: leave out 1500"),
    (["halt"], "no command 'halt', SAY: use run, speed, stop, status, fault, clear"),
    (["run", "-99999"], "-99999 rpm is no speed of the drive: choose a speed between MINIMUM_SPEED_RPM and")])
def test_what_the_drive_would_not_understand_is_refused_in_one_line_and_nothing_is_said(monkeypatch, capsys, words, told):
    monkeypatch.setattr(text.lnet, "open_port", lambda port: pytest.fail("the port was opened"))
    assert text.main(["/dev/null", *words]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1


def test_the_page_shows_the_example_and_lines_with_right_checksums():
    page = (ROOT / "docs" / "application.md").read_text(encoding="utf-8")
    assert (ROOT / "examples" / "my_app.c").read_text(encoding="utf-8") in page
    lines = re.findall(r"`([^`]*\*[0-9A-F]{2})`", page)
    assert len(lines) >= 6 and [line for line in lines if text.content(line) is None] == []


@pytest.mark.parametrize("name", ["panel", "fixed_speed", "analog", "fan", "text", "rc"])
def test_the_page_tells_how_long_each_application_is(name):
    page = (ROOT / "docs" / "application.md").read_text(encoding="utf-8")
    count = len((ROOT / "firmware" / "app" / f"{name}.c").read_text(encoding="utf-8").splitlines())
    assert re.search(rf"^\| `{name}` \| .* \| (\d+) \|", page, re.MULTILINE)[1] == str(count)
    assert name == "panel" or count <= 60
