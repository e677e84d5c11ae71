"""A target's appearance: histograms over bins of colour and texture under kernels, stored views,
and the distance of a state from them; and a second witness of the target, a correlation filter and
templates of grey levels.
"""
