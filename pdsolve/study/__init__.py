"""Many runs of one model: combinations of parameters, each repeated with a small disturbance, in one table.

Crack branching is a random event: statements about it need many runs. `description` reads a study, `run_model` makes
the model of a run, `disturbed` disturbs it, `one_run` solves and measures it, `table` stores the results, `dispatch`
distributes the runs to workers.
"""
