"""How times grow: each module measures one curve of the page on scaling."""
