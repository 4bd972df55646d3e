"""Kinds of tampering with the audit of a store, from an entry changed to a history that is sound in itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.records.forger import KEYS, digest, forging, other_value

if TYPE_CHECKING:
    import random

    from tests.records.forger import Stores


def an_entry_changed(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        entry = forger.entry()
        name = rng.choice(list(entry))
        forger.change("audit", "number", entry["number"], {name: other_value(entry[name], rng)})


def an_entry_of_another_type(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        entry = forger.entry()
        name = rng.choice([name for name in entry if name != "number"])
        forger.change("audit", "number", entry["number"], {name: rng.choice([b"\xff", b"", "", b"\x00"])})


def an_entry_out(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        forger.delete("audit", "number", forger.entry()["number"])


def an_entry_in(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        entries = forger.rows("audit")
        at = rng.randrange(len(entries) + 1)
        new = {**rng.choice(entries), "number": at + 1}
        forger.connection.execute("DELETE FROM audit")
        for number, entry in enumerate([*entries[:at], new, *entries[at:]], start=1):
            forger.insert("audit", {**entry, "number": number})


def entries_reordered(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        one, two = rng.sample(forger.rows("audit"), 2)
        for kept, put in ((one, two), (two, one)):
            forger.change("audit", "number", kept["number"], {**put, "number": kept["number"]})


def entries_renumbered(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        out = forger.entry()["number"]
        forger.delete("audit", "number", out)
        last = forger.rows("audit")[-1]["number"]
        for number in range(out + 1, last + 1):
            forger.connection.execute("UPDATE audit SET number = ? WHERE number = ?", (number - 1, number))
        if rng.random() < 0.5:
            forger.connection.execute("UPDATE audit_head SET number = ?", (last - 1,))


def the_history_rewritten(stores: Stores, rng: random.Random) -> None:
    """A row, its entry, all hashes after it and the head: nothing in the database contradicts anything."""
    with forging(stores.store, rng) as forger:
        table, row = forger.some_row()
        key, kept = KEYS[table], {"store": ("name", "value")}.get(table, (KEYS[table], "frame", "file", "samples"))
        name = rng.choice([name for name in row if name not in kept] or ["value"])
        forger.change(table, key, row[key], {name: other_value(row[name], rng)})
        (new,) = [each for each in forger.rows(table) if each[key] == row[key]]
        entries = forger.rows("audit")
        (*_, last) = [each for each in entries if (each["kind"], each["row"]) == (table, row[key])]
        last["content"] = digest(new)
        forger.rechain(entries)


def an_entry_rewritten(stores: Stores, rng: random.Random) -> None:
    """Who or when, and all hashes after it."""
    with forging(stores.store, rng) as forger:
        entries = forger.rows("audit")
        entry = rng.choice(entries)
        name = rng.choice(["actor", "moment", "action"])
        entry[name] = other_value(entry[name], rng)
        forger.rechain(entries)


def the_end_cut_off(stores: Stores, rng: random.Random) -> None:
    """The last entries, what they entered, and the head."""
    with forging(stores.store, rng) as forger:
        entries = forger.rows("audit")
        left = entries[: -rng.randint(1, 6)]
        cut = entries[len(left) :]
        before = {(each["kind"], each["row"]) for each in left}
        for entry in reversed(cut):
            if (entry["kind"], entry["row"]) not in before:
                forger.delete(entry["kind"], KEYS[entry["kind"]], entry["row"])
        forger.rechain(left)


def the_head_changed(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        (head,) = forger.rows("audit_head")
        kind = rng.randrange(4)
        if kind == 0:
            forger.connection.execute("DELETE FROM audit_head")
        elif kind == 1:
            forger.insert("audit_head", {**head, "id": 0})
        else:
            name = "number" if kind == 2 else "hash"
            forger.change("audit_head", "id", 1, {name: rng.choice([other_value(head[name], rng), b"\xff"])})
