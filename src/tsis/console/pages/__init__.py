"""The pages: one file a page, each built from the bench's state by a call `page(bench, viewer)`."""
