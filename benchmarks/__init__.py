"""Run time against error: each job is a module whose run(quick, folder) gives its page."""
