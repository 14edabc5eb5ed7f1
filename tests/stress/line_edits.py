"""What may happen to the lines of a file by accident; `dice` is a random.Random, `lines` are changed in place."""


def repeat_line(dice, lines):
    lines.insert(dice.randrange(len(lines)), dice.choice(lines))


def swap_lines(dice, lines):
    i, j = dice.randrange(len(lines)), dice.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
