"""Scenes of household things among what is no thing: piled, nested, leaning, in trays."""
