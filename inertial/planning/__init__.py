"""Planning: visibility of effects, expected errors, exchange of poses, discrimination between effects, sequences of dwells."""
