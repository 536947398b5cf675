"""Cases and results of CutBench: reading, checking, formulas, scores. Needs the standard library alone."""

import ast
import functools
import json
import math
import sys
from pathlib import Path

CASES = Path(__file__).resolve().parent / "cases"
FUNCTIONS = {name: getattr(math, name) for name in ("sqrt", "sin", "cos", "tan", "acosh")}
KINDS = {"jump", "intensity", "reaction", "tool_force"}


class BadInput(ValueError):
    """What, where, the value and the limit, in one line."""


def refuse(formula, node, names=()):
    allowed = f"; allowed: {', '.join(sorted({*names, *FUNCTIONS}))}" if names else "; allowed: numbers, names, + - * / **, functions"
    raise BadInput(f"formula '{formula}': '{ast.unparse(node) if isinstance(node, ast.AST) else node}' is none of its parts{allowed}")


@functools.lru_cache(maxsize=None)
def compiled(formula):
    """Code of an expression that holds nothing but numbers, names, + - * / ** and calls of the functions above."""
    try:
        tree = ast.parse(formula, mode="eval")
    except SyntaxError:
        refuse(formula, formula)

    def check(node):
        if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) or isinstance(node, ast.Name):
            return
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            check(node.operand)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)):
            check(node.left)
            check(node.right)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS and not node.keywords:
            for argument in node.args:
                check(argument)
        else:
            refuse(formula, node)

    check(tree.body)
    return compile(tree, "formula", "eval")


def evaluate(formula, names):
    """Value of an expression in the names given: numbers, + - * / **, the functions above and pi."""
    try:
        return float(eval(compiled(formula), {"__builtins__": {}, **FUNCTIONS}, names))
    except NameError as error:
        refuse(formula, error.name, names)
    except (ArithmeticError, ValueError, TypeError) as error:
        raise BadInput(f"formula '{formula}': {error}") from None


def names_of(case, point=None):
    """Parameters of a case, those that are formulas evaluated in their order, and x, y, z of a point."""
    names = {"pi": math.pi}
    for name, given in case["parameters"].items():
        names[name] = evaluate(given, names) if isinstance(given, str) else given
    if point is not None:
        names.update(zip("xyz", map(float, point)))
    return names


def vector(formulas, case, point):
    names = names_of(case, point)
    return [evaluate(formula, names) for formula in formulas]


def moduli_of(case):
    """Young's modulus, Pa, and Poisson's ratio of the law."""
    law, names = case["law"], names_of(case)
    if law["name"] != "linear":
        raise BadInput(f"case '{case['name']}': law.name: '{law['name']}'; allowed: linear")
    return evaluate(law["young_modulus"], names), evaluate(law["poisson_ratio"], names)


def relieved_stress(case, point):
    """3 x 3, Pa: what the cut takes away there; a face with the normal n out of the tissue bears the traction -stress n."""
    stress = [[0.0] * 3 for _ in range(3)]
    names = names_of(case, point)
    for key, formula in case.get("relieves", {}).items():
        i, j = ("xyz".index(letter) for letter in key)
        stress[i][j] = stress[j][i] = evaluate(formula, names)
    return stress


def load_json(file):
    try:
        return json.loads(Path(file).read_text())
    except OSError as error:
        raise BadInput(f"{file}: {error.strerror}") from None
    except ValueError as error:
        raise BadInput(f"{file}: no JSON: {error}") from None


def read_case(name):
    file = CASES / name / "case.json"
    if not file.is_file():
        raise BadInput(f"case '{name}': there is none of that name; allowed: {', '.join(case_names())}")
    return load_json(file)


def case_names():
    return sorted(file.parent.name for file in CASES.glob("*/case.json"))


def chosen_cases(names):
    return [read_case(name) for name in names or case_names()]


def read_result(file):
    result = load_json(file)
    if not isinstance(result, dict):
        raise BadInput(f"{file}: a {type(result).__name__}; allowed: an object")
    for key, kind in {"code": str, "version": str, "command": str, "cases": dict}.items():
        if not isinstance(result.get(key), kind):
            raise BadInput(f"{file}: {key}: {result.get(key)!r}; allowed: a {kind.__name__}")
    for name, entry in result["cases"].items():
        if name not in case_names():
            raise BadInput(f"{file}: cases.{name}: there is no such case; allowed: {', '.join(case_names())}")
        if not isinstance(entry, dict) or not isinstance(entry.get("values"), dict):
            raise BadInput(f"{file}: cases.{name}.values: missing; allowed: an object")
        quantities = {q["name"]: q for q in read_case(name)["quantities"]}
        for key, values in entry["values"].items():
            if key not in quantities:
                raise BadInput(f"{file}: cases.{name}.values.{key}: no quantity of this case; allowed: {', '.join(quantities)}")
            count = len(quantities[key]["values"])
            numbers = isinstance(values, list) and all(isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v) for v in values)
            if not numbers or len(values) != count:
                raise BadInput(f"{file}: cases.{name}.values.{key}: {values!r}; allowed: a list of {count} finite numbers")
    return result


def error_of(quantity, values):
    """Largest error of the values over the scale of the quantity."""
    return max(abs(v - exact) for v, exact in zip(values, quantity["values"])) / quantity["scale_value"]


def score(result):
    """A row for every quantity: case, quantity, error or None where the result has no value, tolerance."""
    rows = []
    for name in case_names():
        values = result["cases"].get(name, {}).get("values", {})
        for quantity in read_case(name)["quantities"]:
            error = error_of(quantity, values[quantity["name"]]) if quantity["name"] in values else None
            rows.append((name, quantity["name"], error, quantity["tolerance"]))
    return rows


def write_result(file, result):
    """Whole or not at all."""
    file = Path(file)
    unfinished = file.with_name(file.name + ".part")
    try:
        unfinished.write_text(json.dumps(result, indent=1) + "\n")
        unfinished.replace(file)
    except OSError as error:
        raise BadInput(f"{file}: {error.strerror}") from None


def run_main(main):
    """Ends the program with what main() returns, with 2 and one line where the input cannot be used."""
    try:
        sys.exit(main())
    except BadInput as error:
        print(f"cutbench: error: {error}", file=sys.stderr)
        sys.exit(2)
