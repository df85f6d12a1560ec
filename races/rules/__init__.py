"""Race rules in forms, API and texts, made from the engine's list (:mod:`paddock.rules.race`)."""
