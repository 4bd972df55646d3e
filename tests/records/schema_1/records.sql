-- A store as the first release of its schema wrote it. Never changed: tests open it with today's program.

CREATE TABLE store (name TEXT NOT NULL PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE targets (id TEXT NOT NULL PRIMARY KEY, number INTEGER NOT NULL UNIQUE, kind TEXT NOT NULL,
    name TEXT NOT NULL, note TEXT NOT NULL, truth TEXT NOT NULL, made TEXT NOT NULL, version INTEGER NOT NULL);
CREATE TABLE calibrations (id TEXT NOT NULL PRIMARY KEY, file TEXT NOT NULL, name TEXT NOT NULL,
    probe TEXT NOT NULL, made TEXT NOT NULL);
CREATE TABLE frames (id TEXT NOT NULL PRIMARY KEY, "rows" INTEGER NOT NULL, "columns" INTEGER NOT NULL,
    bytes INTEGER NOT NULL);
CREATE TABLE presses (id TEXT NOT NULL PRIMARY KEY, target TEXT NOT NULL REFERENCES targets (id),
    role TEXT NOT NULL, taken TEXT NOT NULL, frame TEXT NOT NULL REFERENCES frames (id),
    full_scale DOUBLE PRECISION NOT NULL, force_n DOUBLE PRECISION, mm_per_pixel_x DOUBLE PRECISION,
    mm_per_pixel_y DOUBLE PRECISION, axis_px_x DOUBLE PRECISION NOT NULL, axis_px_y DOUBLE PRECISION NOT NULL,
    probe TEXT NOT NULL, calibration TEXT REFERENCES calibrations (id), settings TEXT NOT NULL, name TEXT NOT NULL,
    version INTEGER NOT NULL);
CREATE TABLE estimates (id TEXT NOT NULL PRIMARY KEY, target TEXT NOT NULL REFERENCES targets (id),
    kind TEXT NOT NULL, made TEXT NOT NULL, probe TEXT NOT NULL, presses TEXT NOT NULL,
    calibration TEXT NOT NULL REFERENCES calibrations (id), options TEXT NOT NULL, environment TEXT NOT NULL,
    supersedes TEXT REFERENCES estimates (id), document TEXT NOT NULL, samples TEXT NOT NULL);
CREATE TABLE audit (number INTEGER NOT NULL PRIMARY KEY, moment TEXT NOT NULL, actor TEXT NOT NULL,
    action TEXT NOT NULL, kind TEXT NOT NULL, "row" TEXT NOT NULL, content TEXT NOT NULL, previous TEXT NOT NULL,
    hash TEXT NOT NULL);
CREATE TABLE audit_head (id INTEGER NOT NULL PRIMARY KEY, number INTEGER NOT NULL, hash TEXT NOT NULL);
CREATE TABLE alembic_version (version_num VARCHAR(32) NOT NULL, CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num));
INSERT INTO alembic_version VALUES ('1');

INSERT INTO store VALUES ('kind', 'phantom');
INSERT INTO store VALUES ('identity', '2a39c39fd87b44aabf99e110c4b49670');
INSERT INTO store VALUES ('made', '2026-11-22T09:31:57.340892+00:00');
INSERT INTO targets VALUES ('d4bcfb520d8a4238a927fb045a480367', 4, 'phantom', 'größe-10b', 'first line
second; it''s', '{"depth_mm":0.1,"diameter_mm":10.0}', '2026-11-22T09:31:57.378244+00:00', 2);
INSERT INTO calibrations VALUES ('1b212f57649c2ecd59a9f82376077763c57250b402f8cec6e9961c1e2ccbb1ec', '52214f45b0b8d0ec707510faf6ad14bd1e0223a4e50b1d7a596f43e7c4d7e6b9', 'bench', 'tsis-2011', '');
INSERT INTO frames VALUES ('8194fd41ba564dde395ae55a9b6980b95183abfe83c36bc13b015c1df65be864', 6, 8, 75);
INSERT INTO frames VALUES ('ff77d000a04ae1cbe8d43ee0964b5ae257b7ab95b3e9cfdff1bb7b33c64cd68f', 6, 8, 100);
INSERT INTO presses VALUES ('45b93e2bbb5547fcb43a0626267ddd74', 'd4bcfb520d8a4238a927fb045a480367', 'plain', '2026-11-22T09:30:00.000000+00:00', '8194fd41ba564dde395ae55a9b6980b95183abfe83c36bc13b015c1df65be864', 255.0, 0.1, 0.12, 0.14, 3.5, 2.5, 'tsis-2011', NULL, '{"exposure_ms":0.3333333333333333,"name":"é","until":{"$number":"infinity"}}', '0.png', 1);
INSERT INTO presses VALUES ('b9d82d6089cf42628d9d60ffaba3d367', 'd4bcfb520d8a4238a927fb045a480367', 'target', '2026-11-22T09:30:01.000000+00:00', 'ff77d000a04ae1cbe8d43ee0964b5ae257b7ab95b3e9cfdff1bb7b33c64cd68f', 4095.0, 1.1, 0.12, 0.14, 3.5, 2.5, 'tsis-2011', '1b212f57649c2ecd59a9f82376077763c57250b402f8cec6e9961c1e2ccbb1ec', '{"exposure_ms":0.3333333333333333,"name":"é","until":{"$number":"infinity"}}', '1.png', 1);
INSERT INTO estimates VALUES ('1153e2562fb34da18b9b17c1ccd1db67', 'd4bcfb520d8a4238a927fb045a480367', 'inclusion', '2026-11-22T09:31:57.664755+00:00', 'tsis-2011', '["45b93e2bbb5547fcb43a0626267ddd74","b9d82d6089cf42628d9d60ffaba3d367"]', '1b212f57649c2ecd59a9f82376077763c57250b402f8cec6e9961c1e2ccbb1ec', '{"prior":{"depth_mm":[4.0,12.0]}}', '{"tsis":"0.1.0"}', NULL, '{"cramer_rao_sd":{"depth_mm":0.47,"diameter_mm":0.38,"young_kpa":"infinity"},"flags":["young_kpa_not_identified"],"identifiability":"Diameter and depth are identified, the modulus is not.","notes":["The modulus is hardly narrower than the prior."],"presence":0.97,"prior":"uniform diameter 1 to 15 mm, depth 4 to 12 mm, modulus 40 to 120 kPa","prior_sd":{"depth_mm":2.31,"diameter_mm":4.04,"young_kpa":23.1},"provenance":{"images":[{"name":"target-1N.png","sha256":"0000000000000000000000000000000000000000000000000000000000000000"}],"tsis":"0.1.0"},"trusted":true}', 'db518bdae318b2e3522e3b33618c5d50a4652d370250f66d5ca849b6f8cb068c');
INSERT INTO audit VALUES (1, '2026-11-22T09:31:57.351232+00:00', 'schema 1', 'add', 'store', 'kind', 'c552bfd5259c6c89b578c15f7d2eec7850462f3bb77d02493a66d98c8ebc1829', '0000000000000000000000000000000000000000000000000000000000000000', '2801cbb75c6ef4a48fc7469d56019e940d2f9a21d2b4168446d2f7a96330c8af');
INSERT INTO audit VALUES (2, '2026-11-22T09:31:57.351232+00:00', 'schema 1', 'add', 'store', 'identity', '9e8dc55551f6f23bfe7ec8f1cc0b4265c38bf14cd97bf85e84e25d23034adfa6', '2801cbb75c6ef4a48fc7469d56019e940d2f9a21d2b4168446d2f7a96330c8af', '1f4c146b12a22e16b8e92df85d9f913a38161ad2e0787d8cf63a30d5f1b9306f');
INSERT INTO audit VALUES (3, '2026-11-22T09:31:57.351232+00:00', 'schema 1', 'add', 'store', 'made', '28485bb9bc604ad57d4a9233b4cd0a205e8f9e99c60d3666fa4b664f626c10e0', '1f4c146b12a22e16b8e92df85d9f913a38161ad2e0787d8cf63a30d5f1b9306f', '16ff6daa36e91bcef516cc6a0b557011eccb351dd92646b297b42a6b6f3b499b');
INSERT INTO audit VALUES (4, '2026-11-22T09:31:57.568121+00:00', 'schema 1', 'add', 'targets', 'd4bcfb520d8a4238a927fb045a480367', '41a11d834eca1059e640e5e6e1f0c6588b55be890320684b05a83429bd3c6fe6', '16ff6daa36e91bcef516cc6a0b557011eccb351dd92646b297b42a6b6f3b499b', 'c5f434bfeea60f87359f31d1ff54ac7fdc1f1ead36d8b0d6fd42c93e17c71d80');
INSERT INTO audit VALUES (5, '2026-11-22T09:31:57.608950+00:00', 'schema 1', 'add', 'frames', '8194fd41ba564dde395ae55a9b6980b95183abfe83c36bc13b015c1df65be864', '9700a6506172ccde8f27489ead15db401e9a55a861849d49a2573a82751f7a7f', 'c5f434bfeea60f87359f31d1ff54ac7fdc1f1ead36d8b0d6fd42c93e17c71d80', 'ae4758726c6f63c3d85827d41fd7c1a80856f74d0e1644185c8f261c16189f10');
INSERT INTO audit VALUES (6, '2026-11-22T09:31:57.608950+00:00', 'schema 1', 'add', 'presses', '45b93e2bbb5547fcb43a0626267ddd74', '3b76b86429cb1df9d005a73ba7b05d0b7c3f8e2f341c0d1e6a26cba62f6f5266', 'ae4758726c6f63c3d85827d41fd7c1a80856f74d0e1644185c8f261c16189f10', 'ac58eff72c8aaa2835288eea66c76d53d65e6aba331f14aaad3ec8f93a922448');
INSERT INTO audit VALUES (7, '2026-11-22T09:31:57.647498+00:00', 'schema 1', 'add', 'calibrations', '1b212f57649c2ecd59a9f82376077763c57250b402f8cec6e9961c1e2ccbb1ec', '06e71e60c1229d64e4b61ac9f7e4a7227191310849d0a6ff19e8418e088218b5', 'ac58eff72c8aaa2835288eea66c76d53d65e6aba331f14aaad3ec8f93a922448', '08ddf479b718be652704d49780ec33f0bfd5ce07fabc10d034d8a063d582885a');
INSERT INTO audit VALUES (8, '2026-11-22T09:31:57.647498+00:00', 'schema 1', 'add', 'frames', 'ff77d000a04ae1cbe8d43ee0964b5ae257b7ab95b3e9cfdff1bb7b33c64cd68f', '62586e0e096c81bee1801d0213f9d376e95b1410878ebde943e736329964962f', '08ddf479b718be652704d49780ec33f0bfd5ce07fabc10d034d8a063d582885a', '9f38b65ace0c0c16f3174b13e26a839d5bec65bde59d5bb11de8227cf46c930d');
INSERT INTO audit VALUES (9, '2026-11-22T09:31:57.647498+00:00', 'schema 1', 'add', 'presses', 'b9d82d6089cf42628d9d60ffaba3d367', '058cfb2002336ba48c891eedc0570b0f00f195b2f586fe14ad5166120b2d77f9', '9f38b65ace0c0c16f3174b13e26a839d5bec65bde59d5bb11de8227cf46c930d', 'e9e02768e4e449fb0f8b642a73d9db1bc11d80dda5e226fb76b9d07039aa7921');
INSERT INTO audit VALUES (10, '2026-11-22T09:31:57.689290+00:00', 'schema 1', 'add', 'estimates', '1153e2562fb34da18b9b17c1ccd1db67', '895ba856cc14c67860874a2546adcc71f106ece8a9b705b808d39d38fd8250ae', 'e9e02768e4e449fb0f8b642a73d9db1bc11d80dda5e226fb76b9d07039aa7921', 'e97fb7281b684bd8922d9c32ef9ca0b7866d278a37b71a88a7cfb087bba9ee22');
INSERT INTO audit VALUES (11, '2026-11-22T09:31:57.705928+00:00', 'schema 1', 'edit', 'targets', 'd4bcfb520d8a4238a927fb045a480367', '4e16e0d631647ff77aed3e5e37517f76f2cb6381dc605c306b148623362d93f4', 'e97fb7281b684bd8922d9c32ef9ca0b7866d278a37b71a88a7cfb087bba9ee22', '62bb9970a4b3207f9998410f71de57b27e873be6085235cf5567ae35cf75f248');
INSERT INTO audit_head VALUES (1, 11, '62bb9970a4b3207f9998410f71de57b27e873be6085235cf5567ae35cf75f248');
