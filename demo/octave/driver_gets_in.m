% SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
% SPDX-License-Identifier: Apache-2.0
%
% Forces of the legs at rest at 1.1 m, empty and with a driver. First, in this folder:
%
%   stewart_export --params ../../config/platform.yaml --output exported
%   octave --eval "mkoctfile --mex -DHEXAPOD=hexapod -Iexported stewart_forces.c exported/hexapod.c exported/stewart_dynamics.c"
%   octave driver_gets_in.m

driver = [82, 0.1, -0.2, 0.6, 9, 0.1, 0.2, 8, -0.3, 3];
[empty, lengths, status] = stewart_forces([0, 0, 1.1], eye(3), [], []);
[laden, ~, with_driver] = stewart_forces([0, 0, 1.1], eye(3), [], [], driver);
printf('%.17g ', lengths); printf('\n');
printf('%.17g ', empty); printf('\n');
printf('%.17g ', laden); printf('\n');
printf('%d %d\n', status, with_driver);
