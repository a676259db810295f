"""make proof NEW=1: what is proved anew, and what is taken as recorded."""

import importlib.util
import sys

import pytest

from tools.common import paths

SOURCE = """/* Of the test.
 *
 * options: -eva-slevel 5
 * modes: proof_sum TUNING */
int sum(int a, int b);
void proof_sum(void)
{
    int s = sum(1, 2); /* small */
    //@ check fits: s == 3;
}
void proof_other(void)
{
}
"""


@pytest.fixture
def proof(tmp_path, monkeypatch):
    spec = importlib.util.spec_from_file_location("proof", paths.ROOT / "test/proof/proof.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "proof", module)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "HERE", tmp_path)
    monkeypatch.setattr(module, "BUILD", tmp_path / "build")
    monkeypatch.setattr(module, "RECORD", tmp_path / "proved.txt")
    monkeypatch.setattr(module, "frama_c", lambda option: {"-version": "1"}.get(option, str(tmp_path)))
    monkeypatch.setattr(module, "is_spot_check", lambda proof, commit: False)
    module.wrong, module.ran = {}, []
    monkeypatch.setattr(module, "run", lambda proof: (module.ran.append(proof.name), (module.wrong.get(proof.name, []), 1.0))[1])
    (tmp_path / "sums.c").write_text(SOURCE, encoding="utf-8")
    return module


def proved(proof, monkeypatch, *words: str) -> tuple[int, list[str]]:
    """Exit status, and the proofs that ran."""
    proof.ran.clear()
    monkeypatch.setattr(sys, "argv", ["proof.py", *words])
    return proof.main(), sorted(proof.ran)


def edit(proof, old: str, new: str) -> None:
    (proof.HERE / "sums.c").write_text(SOURCE.replace(old, new), encoding="utf-8")


def test_without_new_all_run_whatever_is_recorded(proof, monkeypatch) -> None:
    for _ in range(2):
        assert proved(proof, monkeypatch) == (0, ["other", "sum", "sum_TUNING"])


def test_what_passed_and_has_not_changed_is_taken_as_recorded(proof, monkeypatch, capsys) -> None:
    assert proved(proof, monkeypatch, "--new") == (0, ["other", "sum", "sum_TUNING"])
    capsys.readouterr()
    assert proved(proof, monkeypatch, "--new") == (0, [])
    assert capsys.readouterr().out.splitlines()[-1] == "3 passed, 0 failed"


@pytest.mark.parametrize("old, new, runs", [
    ("sum(1, 2)", "sum(1, 3)", True), ("s == 3", "s <= 3", True), ("slevel 5", "slevel 6", True),
    ("small", "a small one", False), ("    int s", "\n\n  int s", False)])
def test_code_an_annotation_or_an_option_is_proved_anew_a_comment_is_not(proof, monkeypatch, old, new, runs) -> None:
    proved(proof, monkeypatch)
    edit(proof, old, new)
    assert proved(proof, monkeypatch, "--new") == (0, ["other", "sum", "sum_TUNING"] if runs else [])


def test_what_only_a_mode_reads_is_proved_anew_in_that_mode(proof, monkeypatch) -> None:
    edit(proof, "int sum(", "#ifdef TUNING\nint more;\n#endif\nint sum(")
    proved(proof, monkeypatch)
    edit(proof, "int sum(", "#ifdef TUNING\nint less;\n#endif\nint sum(")
    assert proved(proof, monkeypatch, "--new") == (0, ["sum_TUNING"])


def test_another_frama_c_proves_all_anew(proof, monkeypatch) -> None:
    proved(proof, monkeypatch)
    monkeypatch.setattr(proof, "frama_c", lambda option: {"-version": "2"}.get(option, str(proof.HERE)))
    assert len(proved(proof, monkeypatch, "--new")[1]) == 3


def test_a_proof_that_fails_is_not_recorded_and_one_that_is_gone_is_forgotten(proof, monkeypatch) -> None:
    proved(proof, monkeypatch)
    proof.wrong["sum"] = ["an alarm"]
    assert proved(proof, monkeypatch, "sum") == (1, ["sum"])
    assert proved(proof, monkeypatch, "--new") == (1, ["sum"])
    edit(proof, "void proof_other(void)\n{\n}\n", "")
    assert proved(proof, monkeypatch)[0] == 1 and proof.read_record().keys() == {"sum_TUNING"}


def test_a_recorded_proof_runs_again_by_spot_check(proof, monkeypatch) -> None:
    proved(proof, monkeypatch)
    monkeypatch.setattr(proof, "is_spot_check", lambda proof, commit: proof.name == "other")
    proof.wrong["other"] = ["an alarm"]
    assert proved(proof, monkeypatch, "--new") == (1, ["other"])


def test_spot_checks_come_to_each_proof_within_some_commits() -> None:
    spec = importlib.util.spec_from_file_location("proof_whole", paths.ROOT / "test/proof/proof.py")
    whole = importlib.util.module_from_spec(spec)
    sys.modules["proof_whole"] = whole
    spec.loader.exec_module(whole)
    one = whole.Proof("tick", "proof_tick", paths.ROOT, [], [], "")
    hits = sum(whole.is_spot_check(one, f"{commit:040x}") for commit in range(400))
    assert 25 <= hits <= 75
    assert {one.name for one in whole.all_proofs() if one.minutes} == {"between", "omega"}
    one.minutes = True
    assert not any(whole.is_spot_check(one, f"{commit:040x}") for commit in range(400))
