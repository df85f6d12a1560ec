"""Race rules as the site tells and asks them: made from the engine's list (:mod:`paddock.rules.race`)."""
