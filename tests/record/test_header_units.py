"""Units in the names of columns, as people write them: found, doubted, or none."""

from math import inf, isnan, pi

import pytest

from stickslip_ros.record.header_units import (
    are_units,
    other_quantity,
    period_in,
    units_in,
    without_unit,
)

TURN, DEGREE = 2.0 * pi, pi / 180.0
NO_UNIT, DOUBTFUL = inf, 0.0
"""In place of a factor: nothing is a unit; what is one is of another quantity, or may be none."""
HEADERS = {
    "s": {
        1e-3: "Zeit [ms]|Zeit in ms|Zeit, ms|Time (msec)|t / ms|t/ms|Time ms|time_ms|timeMs"
        "|TimeMS|TIME_MS"
        "|Время, мс|Время, миллисекунды"
        "|millis|ms|Temps (ms)|temps en ms|Tiempo / ms|Tiempo_ms|ms_today|time_ms_since_boot"
        "|t.ms|t:ms|t-ms|millis()|t_ms1"
        "|Zeit (Millisekunden)|time (milli seconds)|time [milliseconds]"
        "|t (x10^-3 s)|t [1e-3 s]|t (10⁻³ s)|t (E-3 s)|時間 [㎳]|時間\uff08ミリ秒\uff09|时间毫秒",
        1e-6: "timestamp_us|Time [µs]|t / us|micros|zeit_usec",
        1e-9: "timestamp [ns]|nanosec|t_ns",
        1.0: "t [s]|time_s|Zeit in Sekunden|Temps, secondes|tiempo en segundos|Time (sec)",
        60.0: "t [min]|Zeit in min|t / min|Time, min|durée (minutes)",
        DOUBTFUL: "t_min|t_h|min|tick|time_10ms|10us ticks|sample count",
        NO_UNIT: "t|time|Timestamp|data[1]|t_m|index|max|#time|t_d.x|params|Time (abs)",
    },
    "m": {
        1e-3: "Weg / mm|Weg/mm|Weg in mm|Position, mm|Position mm|PositionMM|posMm|pos.mm|x:mm"
        "|x-mm|x_mm|x [mm]|xmm|posmm"
        "|x (mm)|x <mm>|X_MM|Position mm (act)|pos_mm_act|déplacement en mm|Posición (mm)"
        "|spostamento [mm]"
        "|Lage (mm, Ist)|Przemieszczenie (milimetry)|Weg in Millimeter"
        "|Weg in Millimetern|x [milímetros]|pos_mm1|mm10|pos_mm_filt"
        "|Перемещение, мм|x_мм|位移mm|Weg (in mm)|course (millimètres)|x [1e-3 m]|mm",
        0.9144: "x_yards|x [yd]|x in yd",
        1e-10: "x_Å",
        1e-6: "pos, mkm|x [um]|x (µm)|x [micron]|vdcdt_um|Weg / µm|Weg / µ|位置 [㎛]|t (10^-6 m)",
        1e-4: "x [0.1 mm]|x (0,1 mm)|x (in 0.1 mm)",
        1e-2: "pos_cm",
        1e-9: "pos_nm",
        1e-12: "IDS.pos1 [pm]",
        2.54e-8: "x_uin|x in microinches",
        0.0254: "X [in]|X [inch]|x_inch|x / in|x [″]|Position, in|position in inches|Weg in Zoll"
        "|posición en pulgadas",
        2.54e-5: "X (thou)|x_mil",
        1.0: "x [m]|x_m|Weg in m|tacho_meters|phi_rad",
        TURN: "phi_rev|pos [turns]|Winkel in Umdrehungen",
        DEGREE: "phi [Grad]|phi [°]|phi_deg|Winkel in Grad|angle (degrés)|angulo en grados"
        "|Угол, градусы|kat_stopnie",
        DEGREE / 60: "Winkel in Bogenminuten",
        DOUBTFUL: "x_in|position_in|xIn|in|cm|phi [grad]|pos [inc]|Position [counts]|pos_counts"
        "|x *0,001 mm|1000*x [m]|x [m·10⁻³]|x (x1000)|x x1e-3 m|corsa (centesimi)"
        "|1000 x / m|10^3 x / m|1000·x [m]|x10 pos_um"
        "|x (millièmes de m)|Weg 1/100mm"
        "|Encoder count|count|yd|x_yd"
        "|Weg [Inkremente]|Droop pulses (by 1 pls.)|Position [V]|Pos [%]|x (1/1000 mm)"
        "|Weg / mV|x_0.1um"
        "|pos_cnt|pos (qc)|LVDT volts|Position %|[mm]/10|x [mm x 1000]|Weg x10^-3 m"
        "|tenths of mm|thousandths of an inch"
        "|Drehmoment [Nm]|x_mm_s_filt|pos_x1000|usteps|adc",
        NO_UNIT: "x|pos|x_N|phi_h|pos_d|x_min|Position (min)|Position (X)|x_max|data[2]|pos_s|A"
        "|mu|x in Foo|accel_x|in_position|x10|pos_x10|x_amplitude",
    },
    "m/s": {
        1e-3: "Скорость, мм/с|v [mm/s]"
        "|v / (mm/s)|v mm/s|v_mm_s|v in mm/s|v_mm_per_s|v_mmps|v_mmPerS|BandMmProS|vMm_s"
        "|vitesse, mm/s",
        0.3048 / 60: "Belt FPM",
        0.0254: "v_in_per_s",
        1e-3 / 60: "Speed mm/min|feed_mm_min|v_mm_min_filtered",
        1.0: "v [m/s]|v_ms-1|v [ms⁻¹]|v_m_s|omega_rad_s|w [rad/s]",
        TURN / 60: "об/мин|回転数 (転/分)"
        "|rpm|speed_rpm|SpeedRPM|n [1/min]|n / min⁻¹|n [min-1]|n [min^-1]|n [U/min]"
        "|Drehzahl in U/min|tr/min"
        "|giri/min|obroty_obr_min|motor rev/min",
        TURN: "n [rev/s]|f [Hz]",
        1e3 * TURN / 60: "krpm",
        1e-6: "rVel_umps",
        0.44704: "v_mph",
        1852 / 3600: "v_knots",
        DEGREE: "w [deg/s]|w_deg_s|w_dps|°/s|omega_degps",
        DOUBTFUL: "n [1/s]|vel_counts_s|counts_per_s|v_cps|w_rad|rpm_x10|v [mm]|erpm|v_mm|speed_ms",
        NO_UNIT: "v|v_m|v_s|v_min|v_max|Servo motor speed|vel|v_rot",
    },
    "N": {
        1e3: "F (x10³ N)|FkN|F / kN|F_act_kN_act|Усилие, кН|F [kN]|F_kN|force_kn|ForceKN"
        "|Kraft in kN"
        "|Fuerza (kN)|kN applied|Forza in chilonewton|Сила, килоньютоны"
        "|force, kN",
        1.0: "force_N|F_in_N|Kraft in N|F [N]|M [Nm]|T [N·m]|T / Nm|torque_nm|TorqueNm|effort en N"
        "|Kraft (in Newton)",
        1e-3: "torque_mNm|torque_mNm_act|n mN filtered|M [N mm]|F [mN]",
        10.0: "F_daN",
        9.80665: "load [kgf]",
        1.3558179483314: "torque_lbft|M [ftlb]",
        DOUBTFUL: "F_in_N*10|I [Arms]|M [0.1%]|F [t]|F_t|F_dyn|F_dyn_filt|F / t|Last in t|Сила, т"
        "|F / g|F_tons|thrust_grams|load_pct|lb|Force_Pounds|torque_counts"
        "|force_mn|F_N_x1000|M (‰)|I [A]|load [kg]|torque [%]|force_kg|cell_mV|u_V|p_bar",
        NO_UNIT: "F|force|torque|u|A|current_A|x_max|F (t)|Ft|F_T|force_N_filt",
    },
}  # fmt: skip


@pytest.mark.parametrize("target", HEADERS)
def test_the_unit_in_a_name_is_found_or_doubted(target: str) -> None:
    for factor, names in HEADERS[target].items():
        for name in names.split("|"):
            found = units_in(name, "", target)
            if factor == NO_UNIT:
                assert not found, name
            elif factor == DOUBTFUL:
                assert len(found) > 1 or isnan(found[0].factor), name
            else:
                assert [each.factor for each in found] == [pytest.approx(factor)], name


def test_a_line_of_units_counts_for_the_names_above_or_below() -> None:
    for cells, expected in (
        ("ms;mm ±1 µm", True), ("s;mm;kN", True), ("Unit;V;V", True), ("ms;U/min;Grad;inc", True),
        ("t;x;F", False), ("t;s;v", False), ("Time;Pos", False), ("", False),
    ):  # fmt: skip
        assert are_units(cells.split(";")) is expected, cells
    assert [each.factor for each in units_in("x", "mm", "m")] == [1e-3]
    assert {each.factor for each in units_in("x [mm]", "m", "m")} == {1.0, 1e-3}
    assert isnan(units_in("x", "inc", "m")[0].factor)


def test_a_name_tells_another_quantity() -> None:
    names = {
        "accel_x": "an acceleration",
        "x_ms2": "an acceleration",
        "a [m/s²]": "an acceleration",
        "act_current": "a current",
        "iq": "a current",
        "Isq": "a current",
        "motor_power_W": "a power",
    }
    for name in (*names, "raw_x", "x_ms", "current_torque", "Strommoment", "iqr"):
        assert other_quantity(name) == names.get(name), name


def test_a_column_is_also_named_without_its_unit() -> None:
    for name in ("Weg / mm", "Weg [mm]", "Weg (mm)", "Weg in mm", "Weg, mm"):
        assert without_unit(name) == "Weg"
    assert [without_unit(name) for name in ("a/b", "x", "x, y")] == ["", "", ""]


def test_the_period_of_rows_is_told_in_many_ways() -> None:
    for line, expected in (
        ("Sampling time interval(ms),2.000", (2e-3, 2.0)),
        ("Sampling period is 2000000 ns ", (2e-3, 2e6)),
        ("SampleTime[ms]\t2\tSampleTime[ms]\t2", (2e-3, 2.0)),
        ("Abtastzeit = 2,5 ms", (2.5e-3, 2.5)),
        ("Sampling frequency: 500 Hz", (2e-3, None)),
        ("Abtastrate [kHz];0,5", (2e-3, None)),
        ("Number of sampling data,6000", None),
        ("Interval,0.002", None),
        ("Test of 20 ms", None),
    ):
        found = period_in(line)
        assert (found is None) == (expected is None), line
        if found and expected:
            assert found[0] == pytest.approx(expected[0], rel=1e-12)
            assert expected[1] is None or found[1] == expected[1]
