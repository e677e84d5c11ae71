"""A target's appearance: histograms of colour and texture at weighted points, small stored pictures
of the target, and the distance of a state from them; also, for trackers with the setting `witness`,
a correlation filter and templates of grey levels.
"""
