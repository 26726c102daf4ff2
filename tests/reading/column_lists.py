"""Column lists of logs, each with the columns of time, positions and torques and their units.

One row per list: title, time, positions, torques, other columns, units of t, q, tau, joints. `{}`
is the number of a joint, or its name if the row names joints. Units are those that the names show;
without one, s, rad, N*m. The lists are our own, in the words of loggers, vendors and languages.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from runtime.reading.units import position_unit, time_unit, torque_unit

ARM = ("base_yaw", "shoulder", "elbow", "forearm_roll", "wrist_pitch", "flange_roll")
URDF = tuple(f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"))  # fmt: skip


@dataclass(frozen=True)
class ColumnList:
    """Names of the columns of a log, and what they are; a form with {} stands for all joints."""

    title: str
    t: str
    q: str
    tau: str
    others: tuple[str, ...] = ()
    units: tuple[str, ...] = ("s", "rad", "N*m")
    joints: tuple[str, ...] = ()
    first: int = 1

    def of(self, form: str) -> list[str]:
        """Columns of a form; deg|rad in it is deg of the first three joints and rad of the rest."""
        joints = self.in_columns
        return [
            form.replace("deg|rad", "deg" if k < 3 else "rad").format(j)
            for k, j in enumerate(joints)
        ]

    @property
    def in_columns(self) -> Sequence[Any]:
        """Joints as the columns have them: numbers, or names without the word joint."""
        return tuple(j.removesuffix("_joint") for j in self.joints) or range(
            self.first, self.first + 6
        )

    @property
    def names(self) -> list[str]:
        """All columns, the others first."""
        forms = [form for form in (*self.others, self.q, self.tau) if form]
        return [name for name in (self.t, *(x for form in forms for x in self.of(form))) if name]

    def agrees(self, found: Mapping[str, Any]) -> bool:
        """Whether a proposal has these columns and units."""
        columns, units = found.get("columns", {}), found.get("units", {})
        expected = {"t": self.t} if self.t else {}
        for key, form in (("q", self.q), ("tau", self.tau)):
            if form:
                expected[key] = self.of(form)  # type: ignore[assignment]
        return bool(columns == expected) and self._units_agree(units)

    def _units_agree(self, units: Mapping[str, Any]) -> bool:
        t, q, tau = self.units
        q_units = q.split("|")
        wanted = [q_units[0]] * 3 + [q_units[-1]] * 3
        given = units.get("q", "rad")
        given = [given] * 6 if isinstance(given, str) else list(given)
        torque = units.get("tau", "N*m")
        return (
            time_unit(units.get("t", "s")) == time_unit(t)
            and list(map(position_unit, given)) == list(map(position_unit, wanted))
            and isinstance(torque, str)
            and torque_unit(torque) == torque_unit(tau)
        )


L = ColumnList
LISTS = [
    L("units as words, deg beside rad", "stamp_ms", "{}_pos_deg|rad", "{}_load_Nm", units=("ms", "deg|rad", "N*m"), joints=ARM),
    L("deg and rad by number", "time_s", "q{}_deg|rad", "tau{}_Nm", units=("s", "deg|rad", "N*m")),
    L("goals beside joint states", "timestamp", "/joint_states/j{}/position", "/joint_states/j{}/effort", ("goal_q_{}", "goal_qd_{}", "/joint_states/j{}/velocity")),
    L("joint names without the word joint", "time", "{}_pos", "{}_effort", ("{}_vel",), joints=URDF),
    L("joint names in capitals", "Time", "Pos_{}", "Torque_{}", joints=("BASE", "Shoulder", "Elbow", "Roll", "Pitch", "Yaw")),
    L("load in N m", "t", "axis{}_angle_deg", "axis{}_load_Nm", ("axis{}_temp",), ("s", "deg", "N*m")),
    L("current by its unit", "time_ms", "j{}_pos_rad", "j{}_motor_mA", units=("ms", "rad", "mA")),
    L("amperes at the end", "time", "pos_{}", "motor_{}_A", units=("s", "rad", "A")),
    L("desired by one letter", "t", "q_{}", "tau_J_{}", ("q_d_{}", "dq_{}", "tau_J_d_{}")),
    L("desired glued", "t", "qmeas{}", "taumeas{}", ("qdes{}", "taudes{}", "qddes{}")),
    L("reference glued", "time", "q{}", "tau{}", ("qref{}", "tauref{}")),
    L("commands", "time", "pos{}", "torque{}", ("cmdPos{}", "cmdTorque{}")),
    L("setpoints", "time", "axis{}.position", "axis{}.torque", ("axis{}.setpoint.position", "axis{}.setpoint.torque")),
    L("targets", "clock", "act_pos_{}", "act_trq_{}", ("tgt_pos_{}", "tgt_trq_{}")),
    L("planned", "elapsed", "present_position_{}", "present_current_{}", ("planned_position_{}",), ("s", "rad", "A")),
    L("MuJoCo", "time", "qpos{}", "qfrc{}", ("qvel{}", "qacc{}", "ctrl{}"), first=0),
    L("policy", "timestamp", "dof_pos_{}", "dof_torque_{}", ("dof_vel_{}", "action_{}"), first=0),
    L("errors beside", "time", "Axis{}.ActPos", "Axis{}.ActTrq", ("Axis{}.PosError", "Axis{}.SetPos")),
    L("degrees in words", "time [msec]", "Joint {} Angle (degrees)", "Joint {} Torque (N.m)", units=("ms", "deg", "N*m")),
    L("microseconds", "timestamp_us", "position_{}", "effort_{}", units=("us", "rad", "N*m")),
    L("nanoseconds", "stamp_nsec", "position_{}", "effort_{}", units=("ns", "rad", "N*m")),
    L("external torques", "time", "q{}", "tau{}", ("tau_ext{}", "dq{}")),
    L("feedback", "time", "fbk_position_{}", "fbk_effort_{}", ("cmd_position_{}", "cmd_effort_{}")),
    L("speeds in rpm", "time", "J{} [deg]", "J{} [Nm]", ("J{} [rpm]",), ("s", "deg", "N*m")),
    L("speeds in deg/s", "time", "J{}_deg", "J{}_Nm", ("J{}_deg_s",), ("s", "deg", "N*m")),
    L("German, glued", "Zeit", "Istposition{}", "Istmoment{}", ("Sollposition{}", "Sollmoment{}")),
    L("German, umlauts", "Uhrzeit [s]", "Achswinkel {} [Grad]", "Motorstrom {} [A]", ("Führung {} [Grad]",), ("s", "deg", "A")),
    L("German, words", "Zeitstempel", "Gelenkwinkel_{}", "Drehmoment_{}", ("Beschleunigung_{}", "Drehzahl_{}")),
    L("French, accents", "Temps (s)", "Position mesurée {} (degrés)", "Couple mesuré {} (Nm)", ("Position désirée {} (degrés)",), ("s", "deg", "N*m")),
    L("French, reel", "temps_ms", "angle_reel_{}", "courant_{}", ("angle_commande_{}",), ("ms", "rad", "A")),
    L("French, names", "horodatage", "{}_position", "{}_couple", ("{}_vitesse",), joints=("base", "epaule", "coude", "roulis", "tangage", "poignet")),
    L("Spanish", "tiempo", "posición_{}", "par_{}", ("velocidad_{}",)),
    L("Spanish, measured", "tiempo_ms", "ángulo_medido_{}_grados", "corriente_medida_{}", ("ángulo_deseado_{}_grados",), ("ms", "deg", "A")),
    L("Spanish, columns", "Tiempo [s]", "Posición Eje {} [grados]", "Momento Eje {} [Nm]", ("Consigna Eje {} [grados]", "Temperatura Eje {}"), ("s", "deg", "N*m")),
    L("Portuguese", "tempo", "posição_{}", "torque_{}", ("velocidade_{}", "posição_desejada_{}")),
    L("Portuguese, binary", "tempo", "ângulo_junta_{}", "binário_junta_{}", ("referência_ângulo_junta_{}",)),
    L("Italian", "tempo", "posizione_misurata_{}", "coppia_misurata_{}", ("posizione_comandata_{}",)),
    L("Italian, current", "Tempo [ms]", "Angolo {} [gradi]", "Corrente {} [A]", ("Velocità {} [gradi/s]",), ("ms", "deg", "A")),
    L("Dutch", "tijd", "positie_{}", "koppel_{}", ("snelheid_{}", "gewenste_positie_{}")),
    L("Dutch, angle", "tijdstempel", "hoek_as{}_graden", "stroom_as{}", ("temperatuur_as{}",), ("s", "deg", "A")),
    L("Polish", "czas", "położenie_{}", "moment_{}", ("prędkość_{}", "zadane_położenie_{}")),
    L("Polish, angle", "Czas [ms]", "Kąt {} [stopnie]", "Prąd {} [A]", (), ("ms", "deg", "A")),
    L("Turkish", "zaman", "konum_{}", "tork_{}", ("hız_{}", "hedef_konum_{}")),
    L("Turkish, angle", "Zaman (ms)", "Eklem {} Açı (derece)", "Eklem {} Akım (A)", ("Eklem {} Sıcaklık",), ("ms", "deg", "A")),
    L("Russian", "время", "положение_{}", "момент_{}", ("скорость_{}", "заданное_положение_{}")),
    L("Russian, units", "Время, мс", "Угол {} (градус)", "Момент {} (Н·м)", ("Температура {}",), ("ms", "deg", "N*m")),
    L("Chinese", "时间", "关节{}位置", "关节{}力矩", ("关节{}速度", "关节{}目标位置")),
    L("Chinese, units", "时间(ms)", "实际位置{}(度)", "实际扭矩{}(Nm)", ("指令位置{}(度)", "温度{}"), ("ms", "deg", "N*m")),
    L("Chinese, current", "时间戳", "角度{}", "电流{}", ("转速{}",), ("s", "rad", "A")),
    L("Chinese, traditional", "時間", "關節{}角度", "關節{}扭矩", ("關節{}目標角度",)),
    L("Japanese", "時間", "関節角度{}", "トルク{}", ("速度{}", "目標角度{}")),
    L("Japanese, axes", "時刻[ms]", "軸{}位置[deg]", "軸{}電流[A]", ("軸{}指令位置[deg]",), ("ms", "deg", "A")),
    L("Korean", "시간", "관절{} 위치", "관절{} 토크", ("관절{} 속도", "관절{} 목표 위치")),
    L("Korean, current", "시간(ms)", "축{} 각도(deg)", "축{} 전류(A)", ("축{} 온도",), ("ms", "deg", "A")),
    L("no time", "", "pos_{}", "torque_{}"),
    L("no torques", "time", "pos_{}", "", ("vel_{}",)),
    L("no positions", "time", "", "tau_{}", ("vel_{}",)),
    L("nested", "header.stamp", "state.position.{}", "state.effort.{}", ("state.velocity.{}",), first=0),
    L("two arms", "time", "left.joint{}.pos", "left.joint{}.torque", ("left.joint{}.vel",)),
    L("capitals", "TIME", "ACT_POS_{}", "ACT_TORQUE_{}", ("CMD_POS_{}", "ACT_VEL_{}")),
    L("camel case", "timeStamp", "jointPositionDeg{}", "jointTorqueNm{}", ("jointVelocity{}",), ("s", "deg", "N*m")),
    L("dynamixel","time","Present Position {}","Present Current {}",("Goal Position {}","Goal Current {}","Present Velocity {}"),("s","rad","A")),
    L("franka","time","q_{}","tau_J_{}",("dq_{}","tau_ext_hat_filtered_{}","O_T_EE_{}","tau_J_d_{}"),first=0),
    L("kuka fri","timestamp","MeasuredJointPosition{}","MeasuredTorque{}",("CommandedJointPosition{}","CommandedTorque{}","ExternalTorque{}"),first=0),
    L("abb","Time","rob1_{}_position","rob1_{}_torque",("rob1_{}_speed","rob1_{}_ref_position")),
    L("fanuc","Time (s)","J{} Ang (deg)","J{} Dist. Torque",(),("s","deg","N*m")),
    L("ros2 bracket",".header.stamp.sec","/joint_states/position[{}]","/joint_states/effort[{}]",("/joint_states/velocity[{}]",),first=0),
    L("pos_ref","t","q{}_act","i{}_act_A",("q{}_ref","i{}_ref_A"),("s","rad","A")),
    L("setpoint","t","x{}_is_deg","m{}_is_Nm",("x{}_soll_deg","m{}_soll_Nm"),("s","deg","N*m")),
    L("dvrk","ts","jp_{}","jf_{}",("jv_{}","setpoint_jp_{}")),
    L("isaac","time","dof_positions_{}","dof_forces_{}",("dof_velocities_{}","dof_targets_{}"),first=0),
    L("joint cmd later","time","joint{}_position","joint{}_current_mA",("joint{}_position_cmd","joint{}_current_cmd_mA","joint{}_voltage_V"),("s","rad","mA")),
    L("unitree","tick_ms","motor_state.{}.q","motor_state.{}.tau_est",("motor_state.{}.dq","motor_state.{}.ddq","motor_cmd.{}.q","motor_cmd.{}.tau"),("ms","rad","N*m"),first=0),
    L("stamp us","t_us","theta{}_deg","I{}_A",("I{}_ref_A",),("us","deg","A")),
    L("gear","time","output_pos_{}","torque_{}",("temperature_{}","bus_voltage_{}")),
    L("es real","tiempo","pos_real_{}","par_real_{}",("pos_ref_{}","par_ref_{}")),
    L("pt real","tempo","posicao_real_{}","corrente_real_{}",("posicao_desejada_{}",),("s","rad","A")),
    L("ru","t, с","q{} факт, рад","M{} факт, Нм",("q{} зад, рад",)),
    L("zh fb","时间/ms","轴{}反馈位置/deg","轴{}反馈力矩/Nm",("轴{}规划位置/deg",),("ms","deg","N*m")),
    L("de actual","Zeit_ms","IstPos_A{}_deg","IstMom_A{}_Nm",("SollPos_A{}_deg","SollMom_A{}_Nm"),("ms","deg","N*m")),
    L("percent","time","axis{} pos","axis{} torque",("axis{} torque limit","axis{} following error")),
]  # fmt: skip
