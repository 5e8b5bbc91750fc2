"""Everything of many people: who they are, what is known of each, who fits them where, tables, page, learning."""
