"""Large deformations: neo-Hookean bodies that slide on one another without friction and may part.

From the bottom up: the material (`neo_hookean`), bodies of it (`meshed_solid`, `elastic_body`), their shapes
(`rounded_probe`, `bodies`, `ball_mesh`), contact (`smooth_face`, `obstacle`, `sliding_contact`), their energy and the
way through the loads (`potential`, `load_path`), and the two arrangements (`probe_on_slab`, `squeezed_sphere`).
"""
