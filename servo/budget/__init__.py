"""An accuracy budget: what each source of error of a scenario, such as a wrong focal length,
contributes to the camera's error at the end of a run.
"""
