"""The papers' gaits: Zhuang's sequences, swing and stance, Zheng's speeds and margins."""

from __future__ import annotations

from wbplan.papers import zheng_gaits, zhuang_gaits

from .conftest import Judge


def test_zhuang_table_2_sequences(judge: Judge) -> None:
    judge(zhuang_gaits.sequences())


def test_zhuang_section_3_speeds(judge: Judge) -> None:
    judge(zhuang_gaits.speeds())


def test_zhuang_equations_20_to_22_swing(judge: Judge) -> None:
    rows = judge(zhuang_gaits.swing())
    assert abs(float(rows["z at t2, jump"].ours) + 0.283) < 1e-3


def test_zhuang_equations_24_and_25_stance(judge: Judge) -> None:
    rows = judge(zhuang_gaits.stance())
    assert abs(float(rows["quadrangular: feet differ in speed by, of its mean"].ours) - 1.57) < 0.01
    assert abs(float(rows["pentagon: feet differ in speed by, of its mean"].ours) - 1.49) < 0.01


def test_zhuang_section_4_walking_modes(judge: Judge) -> None:
    judge(zhuang_gaits.modes())


def test_zhuang_section_5_ant_walk(judge: Judge) -> None:
    judge(zhuang_gaits.experiment())


def test_zheng_section_4_speeds(judge: Judge) -> None:
    judge(zheng_gaits.speeds())


def test_zheng_section_4_margins(judge: Judge) -> None:
    rows = judge(zheng_gaits.margins())
    for name, worst in (("4+1", (0.284, 0.259)), ("3+2", (0.272, 0.234)), ("mixture", (0.259, 0.209))):
        for pace, expected in zip(("0.05", "0.10"), worst, strict=True):
            assert abs(float(rows[f"{name}: the same, moving by {pace} CR a step"].ours) - expected) < 1e-3
