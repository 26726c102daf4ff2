"""Meanings of the words in the names of columns, in a dozen languages, and the units in names.

    TABLE       one row per language: time, position, torque, current, velocity, measured, commanded
    WORDS       the words of each quantity; words that come first are preferred
    words_of    words of a name: actPos_1 -> {act, pos}

Words have no accents and no capitals: Drehmoment, COUPLE, posición are drehmoment, couple,
posicion. A word of more than three letters, or of Chinese, Japanese or Korean, may stand within a
longer one: Istposition, 关节位置.
"""

from __future__ import annotations

import re
import unicodedata
from contextlib import suppress
from functools import cache

from runtime.ground.errors import InputError
from runtime.reading.units import position_unit, speed_unit, time_unit, torque_unit

LANGUAGES = {  # time | position | torque | current | velocity | measured | commanded
    "en": "t time times timestamp stamp ts tick ticks seconds secs clock elapsed | q qm pos position positions qpos angle angles theta jpos jp | tau torque torques effort efforts moment trq tq tor qfrc jf | current currents cur curr amps | qd dq vel velocity velocities speed speeds qdot qvel jv omega rpm | actual act measured meas feedback fb fbk present real | target tgt desired des ref reference cmd command commanded commands setpoint set goal action ctrl plan planned demand window d",
    "de": "zeit zeitstempel uhrzeit | winkel stellung lage gelenkwinkel achswinkel position | drehmoment moment | strom motorstrom | geschwindigkeit drehzahl | ist istwert gemessen | soll sollwert vorgabe ziel führung",
    "fr": "temps horodatage | position angle | couple couples | courant intensité | vitesse | mesure mesuré mesurée réel réelle | consigne commande cible désirée désiré référence",
    "it": "tempo | posizione posizioni angolo | coppia coppie momento | corrente correnti | velocità | misurata misurato effettiva effettivo reale attuale | riferimento comandata comando obiettivo desiderata desiderato",
    "es": "tiempo | posición posiciones ángulo | par pares momento torque | corriente corrientes | velocidad velocidades | medida medido medición real actual | consigna objetivo deseada deseado referencia comandada comando",
    "pt": "tempo | posição posições ângulo | binário torque momento | corrente correntes | velocidade | medida medido medição atual real | referência desejada desejado comandada alvo",
    "nl": "tijd tijdstip tijdstempel | positie hoek stand | koppel draaimoment | stroom motorstroom | snelheid | gemeten werkelijk werkelijke huidige | gewenst gewenste doel streefwaarde instelwaarde",
    "pl": "czas | pozycja położenie kąt | moment momenty | prąd | prędkość | zmierzony zmierzona zmierzone rzeczywisty rzeczywista aktualna | zadana zadany zadane docelowa",
    "tr": "zaman süre | konum pozisyon açı | tork moment | akım | hız | ölçülen gerçek | hedef istenen komut referans",
    "ru": "время | положени позици угол угла | момент усили | ток тока | скорост | измерен факт фактическ текущ | зад задан желаем целев уставк",
    "zh": "时间 時間 时刻 时间戳 | 位置 角度 关节角 關節角 转角 | 力矩 扭矩 转矩 轉矩 | 电流 電流 | 速度 转速 | 实际 實際 测量 測量 反馈 | 目标 目標 指令 期望 给定 参考 设定",
    "ja": "時間 時刻 タイム | 位置 角度 関節角 | トルク | 電流 | 速度 | 実測 実際 測定 計測 現在 | 目標 指令 指示 参照",
    "ko": "시간 시각 | 위치 각도 | 토크 | 전류 | 속도 | 실제 측정 현재 | 목표 지령 명령 기준",
}  # fmt: skip
OTHER = (
    "qdd ddq acc accel acceleration accelerations qacc jerk temp temperature voltage error err limit "
    "ext external gain kp kd stiffness damping gravity coriolis friction residual noise "
    "beschleunigung temperatur temperatuur spannung fehler tension erreur accélération température "
    "aceleración temperatura tensión aceleração accelerazione tensione errore versnelling "
    "przyspieszenie błąd napięcie sıcaklık ivme gerilim hata ускорени температур напряжени ошибк "
    "加速度 温度 溫度 电压 電壓 電圧 误差 誤差 偏差 가속도 온도 전압 오차"
)
SECONDARY = {"se", "secondary", "link"}  # encoders behind the gears
FOREIGN = str.maketrans({"ß": "ss", "ł": "l", "Ł": "L", "ø": "o", "Ø": "O", "ı": "i", "İ": "I"})
WORD = r"[A-ZА-Я]+(?![a-zа-я])|[A-ZА-Я]?[a-zа-я]+|[^\W\d_A-Za-zА-Яа-я]+"


def plain(text: str) -> str:
    """Return a text without accents; the same text written in two ways gives one result."""
    apart = unicodedata.normalize("NFKD", text.replace("µ", "u").translate(FOREIGN))
    kept = (letter for letter in apart if unicodedata.category(letter) != "Mn")
    return unicodedata.normalize("NFC", "".join(kept))


def _column(place: int) -> tuple[str, ...]:
    """Words of all languages for one kind of quantity, each once."""
    return tuple(
        dict.fromkeys(
            plain(word).lower()
            for row in LANGUAGES.values()
            for word in row.split("|")[place].split()
        )
    )


CURRENTS = _column(3)
MEASURED = _column(5)
COMMANDED = _column(6)
WORDS = {  # the first words of a quantity are taken before the others
    "t": _column(0),
    "q": (*_column(1), "state", "states"),
    "tau": (*_column(2), *CURRENTS, "force", "forces"),
    "qd": _column(4),
    "other": tuple(plain(word).lower() for word in OTHER.split()),
}
QUANTITY_WORDS = {word for key in ("q", "tau", "qd") for word in WORDS[key]}
MODIFIERS = {word for word in (*MEASURED, *COMMANDED) if len(word) > 1}


def words_of(name: str) -> set[str]:
    """Return the words of a column name, in small letters, without units in brackets.

    A word for "measured" or "commanded" glued to a quantity is taken apart: qdes -> {q, des}.
    """
    bare = re.sub(r"[\[(（【][^\])）】]*[\])）】]", " ", name)
    words = {word.lower() for word in re.findall(WORD, plain(bare))}
    for word in [*words]:
        for at in range(1, len(word)):
            head, tail = word[:at], word[at:]
            if (head in MODIFIERS and tail in QUANTITY_WORDS) or (
                tail in MODIFIERS and head in QUANTITY_WORDS
            ):
                words = (words - {word}) | {head, tail}
    return words


def has_word(words: set[str], word: str, exact: bool) -> bool:
    """Whether a word is among the words of a name, or, if not exact, within one of them."""
    if exact:
        return word in words
    return (len(word) > 3 or word[0] > "\u2e80") and any(word in other for other in words)


UNIT_NAMES = {  # as they are written, in small letters and without accents
    "deg": "deg degs degree degrees ° ˚ º grad gradi grados graus degres graden stopnie derece градус градусы 度 도",
    "rad": "rad rads radian radians radiant radianti radianes radianos радиан рад 弧度 라디안 radyan radialen radiany",
    "counts": "count counts cnt",
    "rev": "rev revs turns",
    "mm": "mm",
    "Nm": "nm n*m n·m n-m n.m newtonmeter newtonmeters нм н·м н*м 牛米 牛顿米",
    "mNm": "mnm",
    "N*cm": "ncm",
    "mA": "ma milliamps",
    "A": "amp amps ampere amperes amperios 安 安培 アンペア",
    "ms": "ms msec msecs millis milliseconds мс 毫秒 ミリ秒 밀리초",
    "us": "us usec usecs micros microseconds мкс 微秒",
    "ns": "ns nsec nsecs nanos nanosec nanoseconds nanosecs нс 纳秒",
    "s": "sec sek segundos secondes secondi sekunden sekundy saniye с сек 秒 초",
    "rpm": "rpm",
}  # fmt: skip
UNITS = {word: unit for unit, words in UNIT_NAMES.items() for word in words.split()}
LETTERS = {
    "A": "A",
    "N": "N",
    "m": "m",
    "s": "s",
}  # units only at the end of a name, or in brackets
RATES = re.compile(r"(rad|deg|grad|degree|degrees|mm|m)(?:[_ ]?per[_ ]?|[_/ ])(s|sec|second)(?![a-z])", re.I)  # fmt: skip
READ = {"t": time_unit, "q": position_unit, "tau": torque_unit, "qd": speed_unit}


@cache
def stated_unit(name: str, quantity: str, written: bool = False) -> str:
    """Find the unit of a quantity that a name states, in brackets or as a word; "" if there is
    none.

    written : whether to return the unit as it is written in the name.
    """
    read = READ.get(quantity)
    if read is None:
        return ""
    bracketed = [text.strip() for text in re.findall(r"[\[(（【]([^\])）】#]+)[\])）】]", name)]
    if not bracketed and (rate := RATES.search(name)):
        return (rate[0] if written else "rad/s") if quantity == "qd" else ""
    pieces = [text for text in re.split(r"[\s_/.#\d,:;|-]+", name) if text] if not bracketed else []
    last = re.search(r"[\s_.-]([A-Za-z])$", name)
    listed = [*bracketed, *reversed(pieces)]
    for text in (
        *listed,
        *(
            word
            for piece in reversed(pieces)
            for word in re.findall(WORD, piece)
            if not (word.isupper() and len(word) > 1)  # MACur
        ),
    ):
        unit = UNITS.get(plain(text).lower(), UNITS.get(text.lower(), ""))
        if not unit and text in LETTERS:
            own = text in bracketed or (last is not None and last[1] == text)
            unit = LETTERS[text] if own and not (text == "m" and quantity != "q") else ""
        unit = unit or (text if text in bracketed else "")
        if quantity == "t" and unit and text not in bracketed and text.lower() in WORDS["t"]:
            continue
        with suppress(InputError):  # of something else, or no unit
            if unit:
                read(unit)
                return text if written or (text in bracketed and text == "°") else unit
    return ""
