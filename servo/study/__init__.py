"""Studies: runs of one or several scenarios with each combination of the values of some settings
(axes), with settings drawn at random, and with several seeds.
"""
