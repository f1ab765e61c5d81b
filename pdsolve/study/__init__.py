"""Many runs of one plate: a grid or a list of parameters, each repeated with a small disturbance, in one table.

A crack that branches is a draw from a distribution: what is true of it is true of many runs. `description` reads what
a study is, `making` makes the model of a run, `disturbed` disturbs it, `one` solves and measures it, `table` holds what
was found, `crew` has several processes work on it.
"""
