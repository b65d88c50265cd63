"""Scenario files at random: of a grammar, and shipped ones with changes."""

from random import Random

from stickslip_ros.scenarios.files import shipped_scenarios

_SHIPPED = [
    path.read_text(encoding="utf-8")
    .replace("feed_profile.csv", "''")
    .replace("kind: table", "kind: none")
    for path in shipped_scenarios().values()
]
_PATTERNS = [
    *("/**/plant", "/**/plant", "/**/washout_controller", "/**/analyzer", "/**", "/*/plant"),
    *("/feed_drive/plant", "feed_drive/plant", "/feed_drive/*", "/*/*", "**/plant", "/**/**/plant"),
    *("plant", "/plant/", "//plant", "/**/plant/", "/feed_drive//plant", "/**/damper", "**", "*"),
    *("/**/1plant", "/feed drive/plant", "/**/pl*", "/**/scenario", "/other/plant", "/", "/**/"),
]
_OF_ALL = ("wait_for", "use_sim_time")
_NAMES: dict[str, list[str]] = {
    "plant": [
        *("mass", "mass", "stiffness", "belt_speed", "friction.static", "friction.minimum", "rate"),
        *("initial.position", "initial.velocity", "pace", "friction.law", "expects_control"),
        *("duration", "friction.reverse.static", "friction.reverse.minimum", *_OF_ALL),
    ],
    "washout_controller": ["force_limit", "linear_gain", "cubic_gain", *_OF_ALL],
    "analyzer": ["bag", "bag", "window", *_OF_ALL],
}
_OF_EVERY_NODE = [name for names in _NAMES.values() for name in names]
_ODD_NAMES = ["friction", "kg", "1", "yes", "mass.kg", "friction.reverse", "''", "bag", "mass"]
_SCALARS = [
    *("1e3", "1E-3", "0x10", "0X1f", "-0x1", "010", "-010", "08", "1_000", ".5", "5.", "+1", "-.5"),
    *("+.5e+2", "1.e1", "0", "00", "-0", "-0.0", "1.5", "7.0", "0.3", "0.45", "100.0", "20", "5"),
    *("inf", "-inf", "+inf", ".inf", "-.Inf", "+.INF", "Infinity", "-infinity", "iNf", ".iNf"),
    *("nan", "NaN", ".nan", "-.nan", "+.NaN", "-nan", "nan(1)", "nAn", "0x1.8p1", "0x.8", "0x1p-3"),
    *("1e400", "-1e400", "1e-400", "5e-324", "9223372036854775807", "9223372036854775808"),
    *("-9223372036854775808", "-9223372036854775809", "0x7fffffffffffffff", "0xffffffffffffffff"),
    *("0777777777777777777777777", "01000000000000000000000", "1" * 400, "0x" + "f" * 300, "0o17"),
    *("0b101", "0b2", "1e", "e1", ".", "-", "+", "0x", "1:30", "12:30:45", "2001-01-01", "1d"),
    *("1f",),
    *("yes", "No", "ON", "off", "y", "N", "Y", "tRue", "True", "false", "~", "null", "Null", "''"),
    *("", '""', "'yes'", '"1e3"', "'5'", "!!int 5", "!!int '5'", "!!str 5", "!!float 5", "!!str"),
    *("!!bool yes", "!!null ~", "! 5", "!own 5", "!!str yes", "!<tag:yaml.org,2002:str> 5"),
    *("!!binary aGk=", "!!timestamp 2001-01-01", "!!set {a}", "!!python/none x", "&a 5", "*a"),
    *("lockstep", "realtime", "stribeck", "exponential", "coulomb", "µ", "é=ü", "'it''s'", "a b"),
    *('"\\x41"', '"a\\0b"', '"\\u00e9"', '"1\\n"', "5 # five", "5#five", "a#b", "'#'", "5 6"),
    *("[a, b]", "[analyzer]", "[]", "[1, 2]", "[1, 2.0]", "[a, 1]", "['1', a]", "[yes, no]"),
    *("[[a]]",),
    *("[a, [b], mass]", "[{mass: 5}]", "[a, ]", "[~]", "[,]", "[a b, c]", "[a: b]", "{}", "{a: 1}"),
    *("{static: 0.45}", "{static: 0.45, static: 0.5}", "{a.b: {c: 1}, static: 0.4}", "? a", "- a"),
    *("|-\n{}5", "|\n{}5", ">-\n{}5", ">\n{}a\n{}b", "|-\n{}yes", "|2-\n{}5", "\n{}5", "\n{}- a"),
    *("\n{}- a\n{}- b", "\n{}- - a", "\n{}static: 0.45", "\n{}static: 0.45\n{}minimum: 0.3"),
    *("'1\n{}2'", "1\n{}2", "a\n{}b", "<<", "=", "@a", "`a", "%a", "!", "\t5", "5\t", "\u00a05"),
    *("\u20285", "5\u0085", "\ufeff5", "\x1b", "\u0665", "1\u0660", "5.0e0", "0e0", "1e+05", "1E5"),
]
_LINES = [
    *("---", "...", "--- # again", "%YAML 1.2", "%YAML 1.1\n---", "# comment", "", "  ", "\t"),
    *("<<:",),
    *("{}", "a: b", "&a", "    mass: 9.0", "    friction.static: 0.42"),
    *("    friction: {static: 0.43}",),
    *("      static: 0.44", "  ros__parameters:", "  ros__parameters: {mass: 3.0}", "/**/plant:"),
    *("  plant:", "    <<: {mass: 4.0}", "    ? mass\n    : 6.0", "  other: {}", "    mass:", "}"),
    *("  ros__parameters_too: {mass: 3.0}", "    ros__parameters: {mass: 3.0}"),
    *("    mass: 5.0 6.0",),
    *("/**/plant: {ros__parameters: {mass: 2.0}}",),
    *('"/**": {plant: {ros__parameters: {mass: 2.0}}}',),
    *("  damper: {ros__parameters: {gain: 2.0}}", "    friction.reverse: {static: 0.41}", "- a"),
    *("]",),
]


def fuzzed(random: Random) -> str:
    """Return the text of a file, more often one that ROS reads than not."""
    text = random.choice(_SHIPPED) if random.random() < 0.3 else _of_grammar(random)
    for _ in range(random.choice([0, 0, 0, 0, 1, 1, 2])):
        text = _changed(text, random)
    if random.random() < 0.05:
        text = text.replace("\n", random.choice(["\r\n", "\r"]))
    return ("\ufeff" if random.random() < 0.03 else "") + text


def _of_grammar(random: Random) -> str:
    lines = ["---"] * (random.random() < 0.1)
    fewer = random.choices(_PATTERNS[:12], k=3)
    for _ in range(random.choice([1, 1, 2, 2, 3, 4])):
        odd = random.random() < 0.25
        names = [random.choice(_PATTERNS if odd else fewer)]
        if random.random() < 0.3:
            names = random.choice(
                [["/**", "plant"], ["feed_drive", "plant"], ["/feed_drive", "/plant"],
                 ["/**/", "plant"], ["*", "analyzer"], ["/**", "a/plant"], ["/**", "**", "plant"],
                 ["/", "feed_drive", "plant"], ["feed_drive/", "*"], ["**", "**/plant"]]
            )  # fmt: skip
        names.append("ros__parameters")
        lines += [f"{'  ' * depth}{_key(name, random)}:" for depth, name in enumerate(names)]
        indent = "  " * len(names)
        known = _NAMES.get(names[-2].strip("/").rpartition("/")[2], _OF_EVERY_NODE)
        for name in random.sample(known, random.choice([0, *[1, 2, 3, 4] * 5])):
            lines += _parameter(name, indent, random)
        if random.random() < 0.15:
            lines += _parameter(random.choice(_ODD_NAMES), indent, random)
    return "\n".join(lines) + "\n" * (random.random() < 0.9)


def _key(name: str, random: Random) -> str:
    quote = random.choice(["", "", "'", '"']) or ("'" if name.startswith("*") else "")
    return f"{quote}{name}{quote}"


def _parameter(name: str, indent: str, random: Random) -> list[str]:
    group, dot, last = name.rpartition(".")
    if dot and random.random() < 0.6:
        if random.random() < 0.2:
            return [f"{indent}{group}: {{{last}: {_value(name, '', random)}}}"]
        inner = _parameter(last, indent + "  ", random)
        return [f"{indent}{group}:", *inner]
    return [f"{indent}{name}: {_value(last, indent + '  ', random)}"]


_USUAL = {
    "mass": ["7.0", "80", "1e2"],
    "static": ["0.5", "0.45", "4.5e-1"],
    "minimum": ["0.2", ".15"],
    "pace": ["lockstep", "'realtime'"],
    "law": ["stribeck", "!!str stribeck"],
    "wait_for": ["[analyzer]", "[a, 'b']"],
    "use_sim_time": ["yes", "false", "off"],
    "expects_control": ["on", "N"],
    "window": ["20", "0x10", "010"],
    "bag": ["here", "a b", "'1'"],
}


def _value(name: str, indent: str, random: Random) -> str:
    last = name.rpartition(".")[2]
    usual = _USUAL.get(last, ["5.0", "3", "+.5", "1e1"])
    if random.random() < (0.3 if last == "bag" else 0.75):
        return random.choice(usual)
    return random.choice(_SCALARS).replace("\n{}", f"\n{indent}")


def _changed(text: str, random: Random) -> str:
    lines = text.split("\n")
    place, other = random.randrange(len(lines)), random.randrange(len(lines))
    match random.randrange(8):
        case 0:
            lines.insert(place, random.choice(_LINES))
        case 1:
            lines[other:other] = lines[place : place + random.choice([1, 1, 2, 4])]
        case 2:
            del lines[place]
        case 3:
            lines[place] = random.choice([" ", "  ", "\t"]) + lines[place]
        case 4:
            lines[place] = lines[place].removeprefix("  ")
        case 5:
            key, colon, _ = lines[place].partition(": ")
            lines[place] = f"{key}{colon}{random.choice(_SCALARS).replace('{}', ' ' * 8)}"
        case 6:
            lines += lines[place:]
        case _:
            at = random.randrange(len(lines[place]) + 1)
            odd = random.choice(":#{}[],&*!|>'\"%@-? \t.\u0085\u2028é\x00\x07")
            lines[place] = lines[place][:at] + odd + lines[place][at + random.choice([0, 1]) :]
    return "\n".join(lines)
