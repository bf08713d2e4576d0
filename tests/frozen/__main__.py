"""python -m tests.frozen: write the known results anew, and print how they differ, for review.

The other files in this folder stay as they are: README.md has the rule.
"""

from tests.frozen.known import FOLDER, RESULTS, difference, now

if __name__ == "__main__":
    for path in FOLDER.iterdir():
        if path.name not in RESULTS:
            path.unlink()
            print(f"{path.name}: removed")
    for name in RESULTS:
        made = now(name)
        if changed := difference(name, made):
            print(name, *changed, sep="\n")
            (FOLDER / name).write_text(made, encoding="utf-8")
