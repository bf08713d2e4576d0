"""The colours of all pages, plots and pictures."""

PALETTE = {
    "page": ("#fcfdfe", "#11171d"),
    "panel": ("#f1f5f9", "#1a222b"),
    "ink": ("#1c2733", "#e3e9ee"),
    "muted": ("#566572", "#a3b2bf"),
    "rule": ("#d3dce3", "#33404c"),
    "band": ("#e7f0f7", "#1d2c39"),
    "grey": ("#84919c", "#8796a3"),
    "teal": ("#12877b", "#4fd0c0"),
    "blue": ("#0a5cad", "#6db3f2"),
    "violet": ("#8e1eff", "#ac6bff"),
    "orange": ("#c43e12", "#ff9468"),
    "steel": ("#22303d", "#4d6172"),
    "metal": ("#5d6f7e", "#8497a6"),
}
"""The colours on a light and on a dark page, by role. A plot in a page refers to the role, so it follows the page."""
