"""tools/make/app.sh: an application is compiled alone, reaches nothing but app.h's, and may have another name tomorrow."""

import subprocess

import pytest

from tools.common import paths

HOOKS = "void app_init(void);\nvoid app_ms(void);\nvoid app_init(void) {}\nvoid app_ms(void) {}\n"


def compiled(folder, text: str | None, name: str = "mine.c"):
    if text is not None:
        (folder / name).write_text(text)
    command = [paths.ROOT / "tools" / "make" / "app.sh", "app.o", name, "shown.c", "nm", "gcc", "-Wall", f"-I{paths.ROOT}/include", "-MMD", "-MP"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_an_application_that_has_another_name_now_does_not_stop_make(tmp_path):
    (tmp_path / "makefile").write_text("app.o: $(APP)\n\t@echo built from $(APP)\n-include app.d\n")
    assert compiled(tmp_path, HOOKS).returncode == 0
    (tmp_path / "mine.c").rename(tmp_path / "other.c")
    done = subprocess.run(["make", "APP=other.c"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "built from other.c\n", "")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_an_application_in_utf_16_is_called_so(tmp_path, encoding):
    (tmp_path / "mine.c").write_bytes(b'#line 1 "mine.c"\n' + HOOKS.encode(encoding))
    done = compiled(tmp_path, None)
    assert (done.returncode, done.stderr) == (2, "foc33: shown.c is UTF-16: save it as UTF-8\n")


@pytest.mark.parametrize("text, says", [
    ('#include "drive/drive.h"\n' + HOOKS, '#include "drive/drive.h" in shown.c: an application sees app/ alone'),
    ("#include <math.h>\n" + HOOKS, "#include <math.h> in shown.c: an application sees app/ alone"),
    (HOOKS.replace("app_ms", "my_ms"), "no app_ms() in shown.c"), (HOOKS.replace("app_init", "start"), "no app_init() in shown.c"),
    (HOOKS.replace("void app_ms", "int app_ms"), "int app_ms(void); in shown.c, line 2: write void app_ms( as include/app/app.h has it"),
    (HOOKS.replace("app_ms(void) {}", "app_ms(void) { extern int board_drive; board_drive = 0; }"), "board_drive in shown.c: an application reaches nothing but"),
    (HOOKS.replace("app_ms(void) {}", "app_ms(void) { extern void drive_raise(int); drive_raise(1); }"), "drive_raise in shown.c: an application reaches nothing but")])
def test_an_application_that_reaches_into_the_drive_is_refused_in_one_line_and_leaves_no_object(tmp_path, text, says):
    done = compiled(tmp_path, text)
    assert done.returncode == 2 and done.stderr.startswith(f"foc33: {says}") and done.stderr.count("\n") == 1
    assert not (tmp_path / "app.o").exists()


def test_a_warning_stops_the_build_on_the_pc_as_it_does_for_the_chip(tmp_path):
    done = compiled(tmp_path, HOOKS.replace("app_init(void) {}", "app_init(void) { int idle; }"))
    assert done.returncode != 0 and "mine.c:3:" in done.stderr and "error: unused variable" in done.stderr
    assert not (tmp_path / "app.o").exists()
