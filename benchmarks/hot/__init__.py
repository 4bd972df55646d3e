"""The hot paths of one table: each module builds contests of tsis and its peers out of the other benchmarks."""
