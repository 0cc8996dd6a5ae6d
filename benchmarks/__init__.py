"""What we claim about speed and accuracy, measured: `python -m benchmarks --list`.

Machines differ and are noisy, so that nothing here is a limit. Every figure stands beside that of a peer, of
an empty endpoint or of the paper from the same run, and what is timed is timed in turns (A B A B ...).

    command        which benchmarks run;  timing, printing   turns, medians and tables, for all of them
    paper_rig      the paper's simulated table, and a session of points as it would measure them
    solve_time, solve_growth, detection_time
    live_rate      with the pictures of the next
    detection_accuracy   with its pictures (rendered_plates), their bound (picture_bound), and OpenCV (peer_detectors)
    stop_time      over the emulators of drivers.emulators
    stop_under_load  with its server (table_server) and devices (emulated_table)
    pose_rate, pose_many, pose_in_a_run
                   with their servers (pose_server, bare_server; server_process) and client (http_client)
    true_rig, random_rigs   rigs with known truth, and sessions of theirs with noise
    efficiency     with the bound that it judges by (cramer_rao)
    uncertainty    and its figure in the documentation (uncertainty_figure)
    pictures       with its rendered rigs (rendered_rigs)
    peers          with what they are given (peer_cases), and their own environment (peer_solvers)
    paper_table    with its runs (paper_run), and the rows of both sides (paper_rows)

A benchmark is a module with a docstring that says what it measures, and `run(quick)`, which prints its tables
and returns its main figures by name.
"""
